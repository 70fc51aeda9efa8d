/* The same stage behind CAN FD, protocol version 2 (docs/can-protocol.md), streaming and resident: the logic of
 * the node in portable C99. One bus, up to 18 actuators and 18 sensors: one frame in each direction. */
#ifndef CAN_NODE_H
#define CAN_NODE_H

#include "can_frame.h"
#include "stage_limits.h"

/* 1.25 times the limits, as the host assumes without actuator_range_n and sensor_range_m. */
#define CAN_FORCE_RANGE_N (1.25 * STAGE_FORCE_LIMIT_N)
#define CAN_POSITION_RANGE_M (1.25 * STAGE_WINDOW_M)
/* The text of the fingerprint: change it with the rate, names or ranges. */
#define CAN_FINGERPRINT                                                     \
  "200;100:z1 1.4901161193847656e-06;z2 1.4901161193847656e-06;"            \
  "180:p1 7.4505805969238285e-10;p2 7.4505805969238285e-10;"
enum { CAN_WAVEFORM_BYTES = 1 << 18, CAN_TRACE_BYTES = 1 << 20 };

enum can_resident { IDLE, ARMED, PLAYING, DONE, FAILED };

struct can_node {
  enum stage_state state, shown_state;
  enum stage_cause cause;
  enum can_resident resident;
  uint32_t boot, random, now_us, state_us, setpoint_us, sample_us, heard_us, watchdog_us;
  int interlock_closed, reserved; /* reserved: from arm until stop or silence */
  /* Run: key, and the command that began it. */
  uint32_t session, trace_session, host;
  uint16_t begun_sequence, last_sequence, trigger_sequence;
  uint8_t begun_code;
  uint32_t gaps, repeated, rejected;
  uint64_t sample;
  struct can_message answer; /* of the last setpoint */
  double y_m[STAGE_SENSORS];
  /* Resident. */
  uint64_t mask, digest, samples;
  uint32_t period, ramp, seed_high, seed_low, chunks, missing, next_chunk, end_chunk;
  uint32_t waveform_bytes, trace_bytes;
  uint8_t token, downloads_trace;
  uint8_t received[CAN_WAVEFORM_BYTES / CAN_CHUNK / 8 + 1];
  uint8_t waveform[CAN_WAVEFORM_BYTES], trace[CAN_TRACE_BYTES];
};

struct can_command {
  uint16_t sequence;
  uint8_t code, version;
  uint64_t a, b;
  uint32_t c, d, host, session;
};

void can_node_init(struct can_node* node, uint32_t boot, uint32_t watchdog_us);
void can_node_receive(struct can_node* node, const struct can_message* message);
/* Watchdogs, limits, resident samples, downloads, states: call it at least once per millisecond. */
void can_node_tick(struct can_node* node, uint32_t now_us, int interlock_closed);

/* The bus. Returns 0 if the queue is full; the frame is then not sent. */
int can_send(const struct can_message* message);

/* Shared by can_node.c and can_resident.c. A text is the reason of a refusal; NULL: accepted. */
const char* can_enable(struct can_node* node);
void can_draw_key(struct can_node* node);
void can_begin(struct can_node* node, uint64_t seed);
/* u[n] -> y[n+1]. Returns 0 if the stage was stopped. */
int can_move(struct can_node* node, const double u_n[STAGE_ACTUATORS]);
void can_safe_stop(struct can_node* node, enum stage_state next, enum stage_cause cause);

const char* can_upload(struct can_node* node, const struct can_command* command);
void can_take_chunk(struct can_node* node, const struct can_message* message);
void can_send_missing(const struct can_node* node);
const char* can_arm(struct can_node* node, const struct can_command* command);
const char* can_trigger(struct can_node* node, const struct can_command* command);
const char* can_download(struct can_node* node, const struct can_command* command);
void can_send_chunks(struct can_node* node);
void can_play(struct can_node* node);

#endif
