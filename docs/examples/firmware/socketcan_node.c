/* Runs the CAN node on a computer with SocketCAN:
 *   cc -std=c99 -O2 -o can_node socketcan_node.c can_*.c stage_limits.c stage_plant.c -lm
 *   ./can_node INTERFACE [WATCHDOG_MS] */
#define _DEFAULT_SOURCE
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "can_node.h"

static struct can_node node;
static int bus;

static uint32_t now_us(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (uint32_t)t.tv_sec * 1000000u + (uint32_t)(t.tv_nsec / 1000);
}

int can_send(const struct can_message* message) {
  struct canfd_frame frame;
  memset(&frame, 0, sizeof frame);
  frame.can_id = message->id;
  frame.len = message->length;
  frame.flags = CANFD_BRS;
  memcpy(frame.data, message->data, message->length);
  return write(bus, &frame, sizeof frame) == (ssize_t)sizeof frame;
}

int main(int count, char** arguments) {
  const int on = 1;
  int shown_state = -1, i;
  struct sockaddr_can name;
  memset(&name, 0, sizeof name);
  name.can_family = AF_CAN;
  name.can_ifindex = (int)if_nametoindex(count > 1 ? arguments[1] : "can0");
  bus = socket(PF_CAN, SOCK_RAW, CAN_RAW);
  if (bus < 0 || name.can_ifindex == 0 || setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
      bind(bus, (struct sockaddr*)&name, sizeof name) != 0) {
    perror("cannot open the CAN FD interface");
    return 1;
  }
  fcntl(bus, F_SETFL, O_NONBLOCK);
  can_node_init(&node, ((uint32_t)time(NULL) << 8 ^ (uint32_t)getpid()) | 1u,
                1000u * (count > 2 ? (uint32_t)atoi(arguments[2]) : 200u));
  for (;;) {
    struct canfd_frame frame;
    struct pollfd waiting;
    waiting.fd = bus;
    waiting.events = POLLIN;
    poll(&waiting, 1, 1);
    can_node_tick(&node, now_us(), 1);
    for (i = 0; i < 64 && read(bus, &frame, sizeof frame) == (ssize_t)sizeof frame; ++i) {
      struct can_message message;
      if (frame.len > sizeof message.data || frame.can_id > CAN_SFF_MASK) continue;
      memset(&message, 0, sizeof message);
      message.id = (uint16_t)frame.can_id;
      message.length = frame.len;
      memcpy(message.data, frame.data, frame.len);
      can_node_receive(&node, &message);
    }
    if (shown_state == (int)node.state) continue;
    shown_state = (int)node.state;
    printf("state %d, cause %d, forces", node.state, node.cause);
    for (i = 0; i < STAGE_ACTUATORS; ++i) printf(" %g", stage_hardware_force_n(i));
    printf(" N\n");
    fflush(stdout);
  }
}
