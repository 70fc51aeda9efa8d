/* Runs the CAN node behind ZeroMQ, for a rapid-prototyping controller or any computer without CAN FD. Resident only.
 *   stageid config header stage_zeromq.yaml -o stage.h
 *   cc -std=c99 -O2 -o zeromq_node zeromq_node.c can_*.c stage_limits.c stage_plant.c -lzmq -lm
 *   ./zeromq_node tcp://0.0.0.0:5555 */
#define _DEFAULT_SOURCE
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <zmq.h>

#include "can_node.h"
#include "stage.h"

enum { HOSTS = 8, LARGEST_NAME = 32, MESSAGES_AT_ONCE = 256, TICK_US = 1000 };

/* As on a bus, every host receives every frame. The one that was silent for longest makes place for a new one. */
struct host {
  uint8_t name[LARGEST_NAME];
  int bytes; /* 0: none */
  uint32_t heard;
};
static struct host hosts[HOSTS];
static uint32_t messages;
static struct can_node node;
static void* bus;

static uint32_t now_us(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (uint32_t)t.tv_sec * 1000000u + (uint32_t)(t.tv_nsec / 1000);
}

/* A queue that is full loses the message; the host asks for it again. */
int can_send(const struct can_message* frame) {
  stageid_message message;
  int i;
  memset(&message, 0, sizeof message);
  message.id = frame->id;
  message.length = frame->length;
  memcpy(message.data, frame->data, sizeof message.data);
  for (i = 0; i < HOSTS; ++i)
    if (hosts[i].bytes > 0 && zmq_send(bus, hosts[i].name, (size_t)hosts[i].bytes, ZMQ_SNDMORE | ZMQ_DONTWAIT) >= 0)
      zmq_send(bus, &message, sizeof message, ZMQ_DONTWAIT);
  return 1;
}

static void remember(const struct host* heard) {
  int i, place = 0;
  for (i = 0; i < HOSTS; ++i) {
    if (hosts[i].bytes == heard->bytes && memcmp(hosts[i].name, heard->name, (size_t)heard->bytes) == 0) break;
    if (messages - hosts[i].heard > messages - hosts[place].heard) place = i;
  }
  hosts[i < HOSTS ? i : place] = *heard;
}

/* Returns 0 if there is no message. Anything but a name and one frame is counted as rejected. */
static int receive(void) {
  struct host from;
  stageid_message message;
  struct can_message frame;
  int bytes, more, parts = 1;
  size_t size = sizeof more;
  from.bytes = zmq_recv(bus, from.name, sizeof from.name, ZMQ_DONTWAIT);
  if (from.bytes < 0) return 0;
  for (bytes = 0; zmq_getsockopt(bus, ZMQ_RCVMORE, &more, &size) == 0 && more; ++parts)
    bytes = zmq_recv(bus, &message, sizeof message, ZMQ_DONTWAIT); /* of the whole message, as ZeroMQ counts */
  if (parts != 2 || bytes != (int)sizeof message || message.length > sizeof message.data || message.reserved != 0 ||
      from.bytes == 0 || from.bytes > LARGEST_NAME) {
    ++node.rejected;
    return 1;
  }
  from.heard = ++messages;
  if (message.id == COMMAND) remember(&from);
  memset(&frame, 0, sizeof frame);
  frame.id = message.id;
  frame.length = (uint8_t)message.length;
  memcpy(frame.data, message.data, sizeof frame.data);
  can_node_receive(&node, &frame);
  return 1;
}

int main(int count, char** arguments) {
  const int none = 0;
  int shown_state = -1, i;
  if (can_hash32(CAN_FINGERPRINT) != STAGEID_FINGERPRINT) {
    fprintf(stderr, "stage.h belongs to another stage than can_node.h\n");
    return 1;
  }
  bus = zmq_socket(zmq_ctx_new(), ZMQ_ROUTER);
  zmq_setsockopt(bus, ZMQ_LINGER, &none, sizeof none);
  if (zmq_bind(bus, count > 1 ? arguments[1] : "tcp://127.0.0.1:5555") != 0) {
    fprintf(stderr, "cannot bind: %s\n", zmq_strerror(zmq_errno()));
    return 1;
  }
  can_node_init(&node, ((uint32_t)time(NULL) << 8 ^ (uint32_t)getpid()) | 1u, 200000u);
  for (;;) {
    zmq_pollitem_t waiting;
    memset(&waiting, 0, sizeof waiting);
    waiting.socket = bus;
    waiting.events = ZMQ_POLLIN;
    zmq_poll(&waiting, 1, 1);
    if (now_us() - node.now_us >= TICK_US) can_node_tick(&node, now_us(), 1);
    for (i = 0; i < MESSAGES_AT_ONCE && receive(); ++i) {
    }
    if (shown_state == (int)node.state) continue;
    shown_state = (int)node.state;
    printf("state %d, cause %d, forces", node.state, node.cause);
    for (i = 0; i < STAGE_ACTUATORS; ++i) printf(" %g", stage_hardware_force_n(i));
    printf(" N\n");
    fflush(stdout);
  }
}
