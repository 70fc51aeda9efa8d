/* A stage behind Modbus, register map version 2 (docs/modbus-map.md): the logic of the node in portable C99,
 * without calls of an operating system. The hardware is behind stage_hardware_*(). */
#ifndef STAGE_NODE_H
#define STAGE_NODE_H

#include <stddef.h>
#include <stdint.h>

/* The stage. Rate, names, units and order are those of the stage file of the host. The scales are powers of
 * two; 2^31 of them cover at least twice the limit. */
#define STAGE_RATE_HZ 200.0f
#define STAGE_CHANNELS "z1 N\nz2 N\np1 m\np2 m\n"
enum { STAGE_ACTUATORS = 2, STAGE_SENSORS = 2, STAGE_REGISTERS = 732 };
#define STAGE_FORCE_LIMIT_N 10.0
#define STAGE_FORCE_SCALE_N (1.0 / 67108864.0) /* 2^-26: 32 N */
#define STAGE_WINDOW_M 5e-3
#define STAGE_POSITION_SCALE_M (1.0 / 137438953472.0) /* 2^-37: 16 mm */

enum stage_state { SWITCH_ON_DISABLED = 1, OPERATION_ENABLED = 4, MEASURING = 5, FAULT = 8 };
enum stage_cause { NO_CAUSE = 0, HOST_SILENT = 1, LIMIT = 2, NOT_FINITE = 3, INTERLOCK = 4, HEARTBEAT_LOST = 9 };

struct stage_node {
  uint16_t registers[STAGE_REGISTERS];
  enum stage_state state;
  enum stage_cause cause;
  uint32_t now_ms, watchdog_ms;
  uint32_t random;          /* of the keys */
  uint32_t session, owner;  /* key and connection of the last run */
  uint32_t setpoint_ms;     /* when the last setpoint arrived */
  uint32_t missed;          /* setpoints of this run */
  uint32_t supervisor;      /* connection with the heartbeat; 0: none */
  uint32_t heartbeat_ms;    /* when it changed */
  int heartbeat_started, interlock_closed;
};

/* `boot_id`: not 0 and another one at every start. */
void stage_node_init(struct stage_node* node, uint32_t boot_id, uint32_t watchdog_ms);

/* Checks all times; call it at least once per millisecond. */
void stage_node_tick(struct stage_node* node, uint32_t now_ms, int interlock_closed);

enum { STAGE_LARGEST_PDU = 253 };
/* Answers one Modbus request: function code and data, without address, header or checksum.
 * `connection`: not 0, and never used twice; a serial line is one connection. Returns the bytes of the reply. */
size_t stage_node_answer(struct stage_node* node, uint32_t connection, const uint8_t* request, size_t bytes,
                         uint8_t reply[STAGE_LARGEST_PDU]);

/* Whether this connection has the run or the heartbeat. */
int stage_node_needs(const struct stage_node* node, uint32_t connection);
void stage_node_hung_up(struct stage_node* node, uint32_t connection);

/* The hardware; stage_plant.c is a simulated one. */
/* Amplifiers on, forces zero; samples y[0]. `seed`: for the noise of a simulated stage. */
void stage_hardware_start(uint64_t seed, double y_m[STAGE_SENSORS]);
/* Waits for the next tick of the sample clock, applies u[n] and samples y[n+1]. A simulated stage moves instead. */
void stage_hardware_exchange(const double u_n[STAGE_ACTUATORS], double y_m[STAGE_SENSORS]);
void stage_hardware_stop(void); /* forces zero */
double stage_hardware_force_n(int actuator); /* the one that acts now */

#endif
