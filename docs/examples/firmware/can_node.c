#include "can_node.h"

#include <math.h>
#include <string.h>

enum { VERSION = 2, SATURATED = 0x80, STATE_US = 100000, SILENCE_US = 1000000 };
static const int32_t largest_count = 8388607, no_value = -8388608;

static uint32_t draw(struct can_node* node) { /* xorshift: never 0 */
  node->random ^= node->random << 13;
  node->random ^= node->random >> 17;
  node->random ^= node->random << 5;
  return node->random;
}

void can_draw_key(struct can_node* node) {
  const uint32_t last = node->session & 0xFF;
  do node->session = draw(node);
  while ((node->session & 0xFF) == 0 || (node->session & 0xFF) == last);
}

/* The key of the host that has the stage; 0: none. */
static uint32_t holder(const struct can_node* node) {
  return node->state == MEASURING || node->reserved ? node->session : 0;
}

static void send_state(struct can_node* node, const struct can_command* answered, int accepted, const char* text) {
  struct can_message message;
  uint8_t* data = message.data + CAN_HEADER;
  if (text != NULL) { /* one part of three is enough here */
    memset(&message, 0, sizeof message);
    strncpy((char*)data, text, CAN_CHUNK);
    can_seal(&message, TEXT, CAN_CHUNK, 0, 0, (uint8_t)node->session, 0);
    can_send(&message);
  }
  memset(&message, 0, sizeof message);
  data[0] = VERSION;
  data[1] = (uint8_t)node->cause;
  data[2] = (uint8_t)(answered == NULL ? 0 : accepted ? 1 : 2);
  data[3] = (uint8_t)node->resident;
  can_put(data + 4, node->gaps, 4);
  can_put(data + 8, node->repeated, 4);
  can_put(data + 12, node->rejected, 4);
  can_put(data + 16, node->sample, 8);
  can_put(data + 24, can_hash32(CAN_FINGERPRINT), 4);
  can_put(data + 28, node->boot, 4);
  if (answered != NULL) {
    can_put(data + 32, answered->host, 4);
    if (accepted && answered->host == node->host) can_put(data + 36, holder(node), 4);
  }
  can_seal(&message, STATE, 40, answered != NULL ? answered->sequence : 0, (uint8_t)node->state, (uint8_t)node->session,
       0);
  can_send(&message);
  node->shown_state = node->state;
  node->state_us = node->now_us;
}

void can_node_init(struct can_node* node, uint32_t boot, uint32_t watchdog_us) {
  memset(node, 0, sizeof *node);
  node->state = node->shown_state = SWITCH_ON_DISABLED;
  node->boot = node->random = boot;
  node->watchdog_us = watchdog_us;
  stage_hardware_stop();
}

/* This stage rests on springs, so it is safe without forces. A stage that is not must be braked first. */
void can_safe_stop(struct can_node* node, enum stage_state next, enum stage_cause cause) {
  stage_hardware_stop();
  if (node->resident == PLAYING) node->resident = FAILED;
  if (node->resident == ARMED) node->resident = IDLE;
  node->reserved = 0;
  node->state = next;
  node->cause = cause;
}

static uint32_t to_count(double value, uint8_t* kind) {
  const double limit = largest_count;
  if (isnan(value)) return (uint32_t)no_value;
  if (value > limit || value < -limit) *kind |= SATURATED;
  if (value > limit) return (uint32_t)largest_count;
  if (value < -limit) return (uint32_t)-largest_count;
  return (uint32_t)(int32_t)(value < 0.0 ? value - 0.5 : value + 0.5);
}

static void make_answer(struct can_node* node, uint16_t sequence) {
  uint8_t kind = (uint8_t)node->state;
  int i;
  memset(&node->answer, 0, sizeof node->answer);
  for (i = 0; i < STAGE_SENSORS; ++i)
    can_put(node->answer.data + CAN_HEADER + 3 * i, to_count(node->y_m[i] / (CAN_POSITION_RANGE_M / 8388608.0), &kind), 3);
  can_seal(&node->answer, MEASUREMENT, 3 * STAGE_SENSORS, sequence, kind, (uint8_t)node->session, (uint16_t)node->now_us);
}

int can_move(struct can_node* node, const double u_n[STAGE_ACTUATORS]) {
  const enum stage_cause cause = stage_move(u_n, node->y_m);
  if (cause != NO_CAUSE) can_safe_stop(node, FAULT, cause);
  else ++node->sample;
  node->sample_us = node->now_us;
  return cause == NO_CAUSE;
}

void can_begin(struct can_node* node, uint64_t seed) {
  stage_hardware_start(seed);
  stage_hardware_measure(node->y_m);
  node->state = MEASURING;
  node->sample = 0;
  node->last_sequence = 0;
  node->gaps = node->repeated = 0;
  node->setpoint_us = node->sample_us = node->now_us;
}

const char* can_enable(struct can_node* node) {
  if (!node->interlock_closed) return "the interlock is open; close it";
  if (node->state == FAULT) return "the node is in fault; reset it first";
  if (node->state == SWITCH_ON_DISABLED) node->state = OPERATION_ENABLED;
  return NULL;
}

static const char* stop(struct can_node* node, enum stage_state next) {
  if (node->state == FAULT) return "the node is in fault; reset it first";
  can_safe_stop(node, next, NO_CAUSE);
  node->next_chunk = node->end_chunk;
  return NULL;
}

static int repeats(const struct can_node* node, const struct can_command* command) {
  return command->code == node->begun_code && command->host == node->host && command->sequence == node->begun_sequence;
}

/* Returns why the command is refused, or NULL. */
static const char* obey(struct can_node* node, const struct can_command* command) {
  const uint32_t key = holder(node);
  const int open = command->code == HELLO || command->code == MISSING || command->code == QUICK_STOP ||
                   command->code == RESET_FAULT;
  const char* refusal = NULL;
  if (command->version != VERSION) return "other protocol version; update the older program";
  if (command->code == DOWNLOAD && command->b == 1 && command->session != node->trace_session)
    return "the trace belongs to another host's run";
  if (!open && key != 0 && command->session != key && !repeats(node, command))
    return "another host measures with this stage; wait";
  switch (command->code) {
    case HELLO: return NULL;
    case START:
      if (key != 0 && repeats(node, command) && node->last_sequence == 0) return NULL;
      if (key != 0) return "a run is in progress; stop it first";
      if ((refusal = can_enable(node)) != NULL) return refusal;
      can_draw_key(node);
      can_begin(node, command->a);
      node->resident = IDLE;
      make_answer(node, 0);
      break;
    case STOP:
    case QUICK_STOP: return stop(node, SWITCH_ON_DISABLED);
    case RESET_FAULT:
      if (!node->interlock_closed) return "the interlock is open; close it";
      if (node->state == FAULT) can_safe_stop(node, SWITCH_ON_DISABLED, NO_CAUSE);
      return NULL;
    case UPLOAD: return can_upload(node, command);
    case MISSING: can_send_missing(node); return NULL; /* before the state, at which the host stops waiting */
    case ARM: refusal = can_arm(node, command); break;
    case TRIGGER: return can_trigger(node, command);
    case DOWNLOAD: return can_download(node, command);
    default: return "unknown command";
  }
  if (refusal == NULL) {
    node->host = command->host;
    node->begun_code = command->code;
    node->begun_sequence = command->sequence;
  }
  return refusal;
}

static void take_command(struct can_node* node, const struct can_message* message) {
  const uint8_t* data = message->data + CAN_HEADER;
  struct can_command command;
  const char* refusal;
  if (!can_intact(message, 33)) {
    ++node->rejected;
    return;
  }
  command.sequence = (uint16_t)can_take(message->data, 2);
  command.code = message->data[2];
  command.a = can_take(data, 8);
  command.b = can_take(data + 8, 8);
  command.c = (uint32_t)can_take(data + 16, 4);
  command.d = (uint32_t)can_take(data + 20, 4);
  command.host = (uint32_t)can_take(data + 24, 4);
  command.session = (uint32_t)can_take(data + 28, 4);
  command.version = data[32];
  refusal = obey(node, &command);
  if (refusal == NULL && (command.session == node->session || command.code == ARM)) node->heard_us = node->now_us;
  send_state(node, &command, refusal == NULL, refusal);
  if (command.code == START && refusal == NULL) can_send(&node->answer); /* after the key */
}

static void take_setpoint(struct can_node* node, const struct can_message* message) {
  double u_n[STAGE_ACTUATORS];
  const uint16_t sequence = (uint16_t)can_take(message->data, 2);
  const uint16_t ahead = (uint16_t)(sequence - node->last_sequence);
  int i;
  if (!can_intact(message, 3 * STAGE_ACTUATORS)) {
    ++node->rejected;
    return;
  }
  if (node->session == 0 || node->resident == ARMED || node->resident == PLAYING ||
      message->data[3] != (uint8_t)node->session || can_take(message->data + 4, 2) != (node->session >> 8 & 0xFFFF)) {
    ++node->rejected;
    send_state(node, NULL, 0, NULL);
    return;
  }
  if (ahead == 0 || ahead > 0x7FFF) {
    ++node->repeated;
    if (ahead == 0) can_send(&node->answer);
    return;
  }
  if (node->state != MEASURING) { /* tells the host why */
    send_state(node, NULL, 0, NULL);
    return;
  }
  node->gaps += ahead - 1u;
  node->last_sequence = sequence;
  node->setpoint_us = node->now_us;
  for (i = 0; i < STAGE_ACTUATORS; ++i) {
    const uint32_t bits = (uint32_t)can_take(message->data + CAN_HEADER + 3 * i, 3);
    const int32_t count = (int32_t)bits - (bits > 0x7FFFFF ? 0x1000000 : 0);
    u_n[i] = count == no_value ? NAN : count * (CAN_FORCE_RANGE_N / 8388608.0);
  }
  if (!can_move(node, u_n)) return;
  make_answer(node, sequence);
  can_send(&node->answer);
}

void can_node_receive(struct can_node* node, const struct can_message* message) {
  if (message->id == COMMAND) take_command(node, message);
  else if (message->id == SETPOINT) take_setpoint(node, message);
  else if (message->id == UPLOAD_CHUNK) can_take_chunk(node, message);
}

void can_node_tick(struct can_node* node, uint32_t now_us, int interlock_closed) {
  const int powered = node->state == OPERATION_ENABLED || node->state == MEASURING;
  const int resident = node->resident == ARMED || node->resident == PLAYING;
  node->now_us = now_us;
  node->interlock_closed = interlock_closed;
  if (powered && !interlock_closed) can_safe_stop(node, FAULT, INTERLOCK);
  if (node->reserved && now_us - node->heard_us > SILENCE_US) {
    node->reserved = 0;
    if (node->resident == ARMED) can_safe_stop(node, SWITCH_ON_DISABLED, NO_CAUSE);
    if (node->resident == PLAYING) can_safe_stop(node, FAULT, HOST_SILENT);
  }
  if (!resident && node->state == MEASURING && now_us - node->setpoint_us > node->watchdog_us)
    can_safe_stop(node, FAULT, HOST_SILENT);
  if (node->state == MEASURING && now_us - node->sample_us >= STAGE_WATCH_US) {
    const enum stage_cause cause = stage_watch(1e-6 * (now_us - node->sample_us), node->y_m);
    node->sample_us = now_us;
    if (cause != NO_CAUSE) can_safe_stop(node, FAULT, cause);
  }
  can_play(node);
  can_send_chunks(node);
  if (node->state != node->shown_state || now_us - node->state_us >= STATE_US) send_state(node, NULL, 0, NULL);
}
