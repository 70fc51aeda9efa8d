/* A stage behind Modbus, register map version 2 (docs/modbus-map.md): the logic of the node in portable C99,
 * without calls of an operating system. The stage and its hardware are behind stage_limits.h. */
#ifndef STAGE_NODE_H
#define STAGE_NODE_H

#include <stddef.h>

#include "stage_limits.h"

enum { STAGE_REGISTERS = 732 };

struct stage_node {
  uint16_t registers[STAGE_REGISTERS];
  enum stage_state state;
  enum stage_cause cause;
  uint32_t now_us, watchdog_us;
  uint32_t random;          /* of the keys */
  uint32_t session, owner;  /* key and connection of the last run */
  uint32_t setpoint_us;     /* when the last setpoint arrived */
  uint32_t sample_us;       /* when y_m was sampled */
  double y_m[STAGE_SENSORS];
  uint32_t missed;          /* setpoints of this run */
  uint32_t supervisor;      /* connection with the heartbeat; 0: none */
  uint32_t heartbeat_us;    /* when it changed */
  int heartbeat_started, interlock_closed;
};

/* `boot_id`: not 0 and another one at every start. */
void stage_node_init(struct stage_node* node, uint32_t boot_id, uint32_t watchdog_us);

/* Checks all times, and the stage while it is measured; call it at least once per millisecond. */
void stage_node_tick(struct stage_node* node, uint32_t now_us, int interlock_closed);

enum { STAGE_LARGEST_PDU = 253 };
/* Answers one Modbus request: function code and data, without address, header or checksum.
 * `connection`: not 0, and never used twice; a serial line is one connection. Returns the bytes of the reply. */
size_t stage_node_answer(struct stage_node* node, uint32_t connection, const uint8_t* request, size_t bytes,
                         uint8_t reply[STAGE_LARGEST_PDU]);

/* Whether this connection has the run or the heartbeat. */
int stage_node_needs(const struct stage_node* node, uint32_t connection);
void stage_node_hung_up(struct stage_node* node, uint32_t connection);

#endif
