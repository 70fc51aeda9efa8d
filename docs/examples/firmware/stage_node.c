#include "stage_node.h"

#include <math.h>
#include <string.h>

/* Addresses of the register map. */
enum {
  HEARTBEAT = 0, COMMAND = 2, COMMAND_SEQUENCE = 4,
  RUN_COMMAND = 16, RUN_SEQUENCE = 18, RUN_SEED = 20, RUN_KEY = 24, SETPOINT_SEQUENCE = 26, SETPOINT = 28, WRITABLE_END = 140,
  MAGIC = 200, MAP_VERSION = 202, BOOT_ID = 204, HEARTBEAT_ECHO = 206, STATE = 208, CAUSE = 210, FLAGS = 212,
  COMMAND_ECHO = 214, COMMAND_REPLY = 216,
  MEASUREMENT_BOOT_ID = 300, MEASUREMENT_SEQUENCE = 302, SESSION = 304, MEASUREMENT_STATUS = 306, VALID = 308,
  MEASUREMENT = 312, ACTUATORS = 500, SENSORS = 502, SAMPLE_RATE = 504, CHANNEL_HASH = 506, ACTUATOR_SCALE = 508,
  SENSOR_SCALE = 620
};

enum { ILLEGAL_FUNCTION = 1, ILLEGAL_ADDRESS = 2, ILLEGAL_VALUE = 3, DEVICE_FAILURE = 4, BUSY = 6 };
enum { ENABLE = 1, DISABLE = 2, QUICK_STOP = 3, RESET_FAULT = 4 };
enum { RUN_BEGIN = 1, RUN_END = 2 };
enum { OUTCOME_OK = 0, OUTCOME_FAULT = 8, OUTCOME_LIMIT = 9 };
enum { HEARTBEAT_TIMEOUT_US = 1000000 };
static const int32_t largest_count = 2147483647;

static uint32_t get(const struct stage_node* node, int address) {
  return (uint32_t)node->registers[address] << 16 | node->registers[address + 1];
}

static void set(struct stage_node* node, int address, uint32_t value) {
  node->registers[address] = (uint16_t)(value >> 16);
  node->registers[address + 1] = (uint16_t)value;
}

static void set_float(struct stage_node* node, int address, float value) {
  uint32_t bits; /* IEEE 754 */
  memcpy(&bits, &value, sizeof bits);
  set(node, address, bits);
}

static double signed_count(uint32_t bits) { return bits < 0x80000000u ? (double)bits : (double)bits - 4294967296.0; }

/* A saturated count makes the host stop the run. */
static uint32_t to_count(double value) {
  if (!(value < largest_count)) return (uint32_t)largest_count;
  if (value < -largest_count) return (uint32_t)-largest_count;
  return (uint32_t)(int32_t)(value < 0.0 ? value - 0.5 : value + 0.5);
}

static uint32_t hash(const char* text) { /* FNV-1a */
  uint32_t value = 2166136261u;
  for (; *text != '\0'; ++text) value = (value ^ (uint8_t)*text) * 16777619u;
  return value;
}

static uint32_t draw_key(struct stage_node* node) { /* xorshift: never 0 */
  node->random ^= node->random << 13;
  node->random ^= node->random >> 17;
  node->random ^= node->random << 5;
  return node->random;
}

/* A sensor that is NaN has no value; without `y_m`, none has. */
static void set_measurement(struct stage_node* node, uint32_t sequence, uint32_t outcome, const double* y_m) {
  uint32_t valid = 0; /* up to 32 sensors */
  int i;
  set(node, MEASUREMENT_SEQUENCE, sequence);
  set(node, MEASUREMENT_STATUS,
      outcome | (uint32_t)node->state << 8 | (uint32_t)node->cause << 16 | node->missed << 24);
  for (i = 0; i < STAGE_SENSORS; ++i) {
    const int has_value = y_m != NULL && !isnan(y_m[i]);
    if (has_value) valid |= 1u << i;
    set(node, MEASUREMENT + 2 * i, has_value ? to_count(y_m[i] / STAGE_POSITION_SCALE_M) : 0);
  }
  set(node, VALID + 2, valid);
}

void stage_node_init(struct stage_node* node, uint32_t boot_id, uint32_t watchdog_us) {
  int i;
  memset(node, 0, sizeof *node);
  node->state = SWITCH_ON_DISABLED;
  node->random = boot_id;
  node->watchdog_us = watchdog_us;
  set(node, MAGIC, 0x53544749u);
  set(node, MAP_VERSION, 2);
  set(node, BOOT_ID, boot_id);
  set(node, MEASUREMENT_BOOT_ID, boot_id);
  set(node, ACTUATORS, STAGE_ACTUATORS);
  set(node, SENSORS, STAGE_SENSORS);
  set_float(node, SAMPLE_RATE, STAGE_RATE_HZ);
  set(node, CHANNEL_HASH, hash(STAGE_CHANNELS));
  for (i = 0; i < STAGE_ACTUATORS; ++i) set_float(node, ACTUATOR_SCALE + 2 * i, (float)STAGE_FORCE_SCALE_N);
  for (i = 0; i < STAGE_SENSORS; ++i) set_float(node, SENSOR_SCALE + 2 * i, (float)STAGE_POSITION_SCALE_M);
  stage_hardware_stop();
}

/* This stage rests on springs, so it is safe without forces. A stage that is not must be braked first. */
static void safe_stop(struct stage_node* node, enum stage_state next, enum stage_cause cause) {
  stage_hardware_stop();
  node->state = next;
  node->cause = cause;
}

static void obey_limits(struct stage_node* node, enum stage_cause cause) {
  if (cause != NO_CAUSE) safe_stop(node, FAULT, cause);
  node->sample_us = node->now_us;
}

static int powered(const struct stage_node* node) {
  return node->state == OPERATION_ENABLED || node->state == MEASURING;
}

void stage_node_tick(struct stage_node* node, uint32_t now_us, int interlock_closed) {
  node->now_us = now_us;
  node->interlock_closed = interlock_closed;
  if (!powered(node)) {
    node->heartbeat_started = 0;
    node->supervisor = 0;
  } else if (!interlock_closed) {
    safe_stop(node, FAULT, INTERLOCK);
  } else if (node->heartbeat_started && now_us - node->heartbeat_us > HEARTBEAT_TIMEOUT_US) {
    safe_stop(node, FAULT, HEARTBEAT_LOST);
  } else if (node->state == MEASURING && now_us - node->setpoint_us > node->watchdog_us) {
    safe_stop(node, FAULT, HOST_SILENT);
  } else if (node->state == MEASURING && now_us - node->sample_us >= STAGE_WATCH_US) {
    obey_limits(node, stage_watch(1e-6 * (now_us - node->sample_us), node->y_m));
  }
}

/* Returns whether the command is accepted. */
static int take_command(struct stage_node* node, uint32_t command) {
  const int fault = node->state == FAULT;
  if (command < ENABLE || command > RESET_FAULT) return 0;
  if (!node->interlock_closed && (command == ENABLE || command == RESET_FAULT)) return 0;
  if (fault && command != RESET_FAULT) return 0;
  if (node->state == MEASURING && command == DISABLE) return 0;
  if (command == ENABLE && node->state == SWITCH_ON_DISABLED) node->state = OPERATION_ENABLED;
  if (command == DISABLE || command == QUICK_STOP || fault) safe_stop(node, SWITCH_ON_DISABLED, NO_CAUSE);
  return 1;
}

static int take_run_command(struct stage_node* node, uint32_t connection) {
  const uint32_t command = get(node, RUN_COMMAND);
  if (command != RUN_BEGIN && command != RUN_END) return ILLEGAL_VALUE;
  if (command == RUN_BEGIN) {
    if (node->state == MEASURING) return BUSY;
    if (node->state != OPERATION_ENABLED) return DEVICE_FAILURE;
    stage_hardware_start((uint64_t)get(node, RUN_SEED) << 32 | get(node, RUN_SEED + 2));
    stage_hardware_measure(node->y_m);
    node->state = MEASURING;
    node->session = draw_key(node);
    node->owner = connection;
    node->setpoint_us = node->sample_us = node->now_us;
  } else if (node->state == MEASURING) {
    safe_stop(node, OPERATION_ENABLED, NO_CAUSE);
  }
  node->missed = 0;
  set(node, SETPOINT_SEQUENCE, 0);
  set_measurement(node, 0, OUTCOME_OK, command == RUN_BEGIN ? node->y_m : NULL);
  return 0;
}

/* u[n] -> y[n+1] */
static void take_setpoint(struct stage_node* node) {
  double u_n[STAGE_ACTUATORS];
  uint32_t outcome = OUTCOME_FAULT;
  int i;
  const uint32_t sequence = get(node, SETPOINT_SEQUENCE);
  const uint32_t ahead = sequence - get(node, MEASUREMENT_SEQUENCE);
  if (ahead == 0 || ahead > 0x7FFFFFFFu) return; /* repeated or older: the last measurement is the answer */
  node->missed = ahead - 1 < 255 - node->missed ? node->missed + ahead - 1 : 255;
  if (node->state == MEASURING) {
    for (i = 0; i < STAGE_ACTUATORS; ++i) u_n[i] = STAGE_FORCE_SCALE_N * signed_count(get(node, SETPOINT + 2 * i));
    obey_limits(node, stage_move(u_n, node->y_m));
    node->setpoint_us = node->now_us;
    outcome = node->state == MEASURING ? OUTCOME_OK : OUTCOME_LIMIT;
  }
  set_measurement(node, sequence, outcome, outcome == OUTCOME_FAULT ? NULL : node->y_m);
}

/* Whether this write may reach the registers of the run. */
static int may_control_run(const struct stage_node* node, uint32_t connection, int commands, int moves) {
  const int owner = node->session != 0 && connection == node->owner;
  if (owner && get(node, RUN_KEY) == node->session) return 1;
  if (owner && !commands && !moves) return 1; /* a repeated begin */
  return node->state != MEASURING && commands && get(node, RUN_COMMAND) == RUN_BEGIN;
}

/* Acts on what has changed. Returns an exception or 0. */
static int obey(struct stage_node* node, uint32_t connection, const uint16_t* before, unsigned first,
                unsigned count) {
  const int beats = memcmp(before + HEARTBEAT, node->registers + HEARTBEAT, 4) != 0;
  const int orders = memcmp(before + COMMAND_SEQUENCE, node->registers + COMMAND_SEQUENCE, 4) != 0;
  const int commands = memcmp(before + RUN_SEQUENCE, node->registers + RUN_SEQUENCE, 4) != 0;
  const int moves = first < SETPOINT_SEQUENCE + 2 && first + count > SETPOINT_SEQUENCE;
  int refused;
  if (beats && node->supervisor != 0 && node->supervisor != connection) return BUSY;
  if (first + count > RUN_COMMAND && !may_control_run(node, connection, commands, moves)) return BUSY;
  if (commands && (refused = take_run_command(node, connection)) != 0) return refused;
  if (beats) {
    node->supervisor = connection;
    node->heartbeat_started = 1;
    node->heartbeat_us = node->now_us;
  }
  if (orders) {
    set(node, COMMAND_REPLY, take_command(node, get(node, COMMAND)) ? 1 : 2);
    set(node, COMMAND_ECHO, get(node, COMMAND_SEQUENCE));
  }
  if (moves) take_setpoint(node);
  return 0;
}

static unsigned word(const uint8_t* bytes) { return (unsigned)bytes[0] << 8 | bytes[1]; }

static int write_registers(struct stage_node* node, uint32_t connection, unsigned first, unsigned count,
                           const uint8_t* data) {
  uint16_t before[WRITABLE_END];
  unsigned i;
  int refused;
  if (first + count > WRITABLE_END) return ILLEGAL_ADDRESS;
  memcpy(before, node->registers, sizeof before);
  for (i = 0; i < count; ++i) node->registers[first + i] = (uint16_t)word(data + 2 * i);
  refused = obey(node, connection, before, first, count);
  if (refused != 0) memcpy(node->registers, before, sizeof before);
  set(node, RUN_KEY, 0); /* others must not read it */
  return refused;
}

static int read_registers(struct stage_node* node, uint32_t connection, unsigned first, unsigned count,
                          uint8_t* reply) {
  unsigned i;
  if (first + count > STAGE_REGISTERS) return ILLEGAL_ADDRESS;
  set(node, HEARTBEAT_ECHO, get(node, HEARTBEAT));
  set(node, STATE, node->state);
  set(node, CAUSE, node->cause);
  set(node, FLAGS, (node->interlock_closed ? 1u : 0u) | (powered(node) ? 2u : 0u));
  set(node, SESSION, connection == node->owner ? node->session : 0);
  reply[1] = (uint8_t)(2 * count);
  for (i = 0; i < count; ++i) {
    reply[2 + 2 * i] = (uint8_t)(node->registers[first + i] >> 8);
    reply[3 + 2 * i] = (uint8_t)node->registers[first + i];
  }
  return 0;
}

static int reads(int function) { return function == 3 || function == 4 || function == 23; }
static int writes(int function) { return function == 6 || function == 16 || function == 23; }

static int answer(struct stage_node* node, uint32_t connection, const uint8_t* request, size_t bytes, uint8_t* reply) {
  const int function = request[0];
  uint8_t pdu[STAGE_LARGEST_PDU] = {0}; /* a request that is too short ends with zeros */
  const uint8_t* at = pdu + 1;
  unsigned first = 0, count = 1, to_read = 0;
  int refused;
  if (!reads(function) && !writes(function)) return ILLEGAL_FUNCTION;
  if (bytes > sizeof pdu) return ILLEGAL_VALUE;
  memcpy(pdu, request, bytes);
  memcpy(reply + 1, pdu + 1, 4); /* the reply to a write */
  if (reads(function)) {
    to_read = word(at + 2);
    if (to_read < 1 || to_read > 125) return ILLEGAL_VALUE;
    at += 4;
  }
  if (writes(function)) {
    first = word(at);
    at += 2;
    if (function != 6) { /* which writes one register */
      count = word(at);
      if (count < 1 || count > (reads(function) ? 121 : 123) || at[2] != 2 * count) return ILLEGAL_VALUE;
      at += 3;
    }
    at += 2 * count;
  }
  if (at != pdu + bytes) return ILLEGAL_VALUE;
  if (writes(function) && (refused = write_registers(node, connection, first, count, at - 2 * count)) != 0)
    return refused;
  return reads(function) ? read_registers(node, connection, word(pdu + 1), to_read, reply) : 0;
}

size_t stage_node_answer(struct stage_node* node, uint32_t connection, const uint8_t* request, size_t bytes,
                         uint8_t reply[STAGE_LARGEST_PDU]) {
  int refused;
  if (bytes == 0) return 0;
  reply[0] = request[0];
  refused = answer(node, connection, request, bytes, reply);
  if (refused == 0) return reads(request[0]) ? 2 + (size_t)reply[1] : 5;
  reply[0] = request[0] | 0x80;
  reply[1] = (uint8_t)refused;
  return 2;
}

int stage_node_needs(const struct stage_node* node, uint32_t connection) {
  return connection == node->supervisor || (node->state == MEASURING && connection == node->owner);
}

/* The run does not end here: the watchdog stops the stage. */
void stage_node_hung_up(struct stage_node* node, uint32_t connection) {
  if (node->supervisor == connection) node->supervisor = 0;
}
