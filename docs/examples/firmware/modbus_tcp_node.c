/* Runs the node on a computer, over Modbus TCP on the loopback interface:
 *   cc -std=c99 -O2 -o node modbus_tcp_node.c stage_*.c -lm
 *   ./node PORT [WATCHDOG_MS]      PORT 0: a free one
 * On a microcontroller, the loop in main() becomes that of its TCP stack or serial line. */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "stage_node.h"

enum { CLIENTS = 16, UNIT = 1, HEADER = 7, GATEWAY_TARGET = 11, PATIENCE_US = 1000000 };
struct client {
  int socket;          /* -1: unused */
  uint32_t connection; /* never used twice */
  uint32_t request; /* number of the last one */
  uint32_t byte_us; /* when the last one arrived */
  size_t bytes;
  uint8_t data[HEADER + STAGE_LARGEST_PDU];
};
static struct client clients[CLIENTS];
static struct stage_node node;
static uint32_t requests;

static uint32_t now_us(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (uint32_t)t.tv_sec * 1000000u + (uint32_t)(t.tv_nsec / 1000);
}

static void hang_up(struct client* client) {
  close(client->socket);
  client->socket = -1;
  stage_node_hung_up(&node, client->connection);
}

/* A free place, or that of the client whose last request is the oldest. */
static struct client* place(void) {
  struct client* oldest = NULL;
  int i;
  for (i = 0; i < CLIENTS; ++i) {
    if (clients[i].socket < 0) return &clients[i];
    if (!stage_node_needs(&node, clients[i].connection) &&
        (oldest == NULL || requests - clients[i].request > requests - oldest->request))
      oldest = &clients[i];
  }
  if (oldest != NULL) hang_up(oldest);
  return oldest;
}

static void accept_client(int listener) {
  static uint32_t connections = 0;
  const int on = 1, socket = accept(listener, NULL, NULL);
  struct client* client = socket < 0 ? NULL : place();
  if (client == NULL) {
    if (socket >= 0) close(socket);
    return;
  }
  fcntl(socket, F_SETFL, O_NONBLOCK);
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on); /* a reply must not wait for the next one */
  client->socket = socket;
  client->connection = ++connections;
  client->request = requests;
  client->byte_us = node.now_us;
  client->bytes = 0;
}

/* MBAP header: transaction, protocol 0, bytes that follow, unit. Returns 0 if the client must be dropped. */
static int answer(struct client* client) {
  uint8_t reply[HEADER + STAGE_LARGEST_PDU];
  uint8_t* data = client->data;
  while (client->bytes >= HEADER) {
    const size_t length = (size_t)data[4] << 8 | data[5], whole = length + 6;
    size_t pdu = 2;
    if (data[2] != 0 || data[3] != 0 || length < 2 || whole > sizeof client->data) return 0;
    if (client->bytes < whole) return 1;
    memcpy(reply, data, HEADER);
    if (data[6] == UNIT) {
      pdu = stage_node_answer(&node, client->connection, data + HEADER, whole - HEADER, reply + HEADER);
    } else {
      reply[HEADER] = data[HEADER] | 0x80;
      reply[HEADER + 1] = GATEWAY_TARGET;
    }
    reply[4] = 0;
    reply[5] = (uint8_t)(pdu + 1);
    client->request = ++requests;
    memmove(data, data + whole, client->bytes -= whole);
    if (send(client->socket, reply, HEADER + pdu, MSG_NOSIGNAL) != (ssize_t)(HEADER + pdu)) return 0;
  }
  return 1;
}

static void serve(struct client* client) {
  const ssize_t got = recv(client->socket, client->data + client->bytes, sizeof client->data - client->bytes, 0);
  if (got > 0) {
    client->bytes += (size_t)got;
    client->byte_us = node.now_us;
  }
  if (got <= 0 || !answer(client)) hang_up(client);
}

int main(int count, char** arguments) {
  struct sockaddr_in name;
  socklen_t size = sizeof name;
  const int on = 1, listener = socket(AF_INET, SOCK_STREAM, 0);
  int shown_state = -1, i;
  memset(&name, 0, sizeof name);
  name.sin_family = AF_INET;
  name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  name.sin_port = htons((uint16_t)(count > 1 ? atoi(arguments[1]) : 1502));
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (bind(listener, (struct sockaddr*)&name, size) != 0 || listen(listener, CLIENTS) != 0) {
    perror("cannot listen; use another port");
    return 1;
  }
  getsockname(listener, (struct sockaddr*)&name, &size);
  printf("port %d\n", ntohs(name.sin_port));
  for (i = 0; i < CLIENTS; ++i) clients[i].socket = -1;
  /* Longer than worst_reply_s + response_s + a sample of stage.yaml, so that a lost reply can be repeated. */
  stage_node_init(&node, ((uint32_t)time(NULL) << 8 ^ (uint32_t)getpid()) | 1u,
                  1000u * (count > 2 ? (uint32_t)atoi(arguments[2]) : 710));
  for (;;) {
    struct pollfd waiting[CLIENTS + 1];
    for (i = 0; i < CLIENTS; ++i) {
      waiting[i].fd = clients[i].socket; /* poll() ignores -1 */
      waiting[i].events = POLLIN;
    }
    waiting[CLIENTS].fd = listener;
    waiting[CLIENTS].events = POLLIN;
    poll(waiting, CLIENTS + 1, 1);
    stage_node_tick(&node, now_us(), 1);
    for (i = 0; i < CLIENTS; ++i) {
      if (clients[i].socket < 0) continue;
      if (waiting[i].revents != 0) serve(&clients[i]);
      else if (clients[i].bytes > 0 && node.now_us - clients[i].byte_us > PATIENCE_US) hang_up(&clients[i]);
    }
    if (waiting[CLIENTS].revents != 0) accept_client(listener);
    if (shown_state == (int)node.state) continue;
    shown_state = (int)node.state;
    printf("state %d, cause %d, forces", node.state, node.cause);
    for (i = 0; i < STAGE_ACTUATORS; ++i) printf(" %g", stage_hardware_force_n(i));
    printf(" N\n");
    fflush(stdout);
  }
}
