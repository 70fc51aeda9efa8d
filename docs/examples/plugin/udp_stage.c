/* A stage connected by UDP, as a back end for stageid. One datagram per sample in each direction:
 *   to the stage:   uint64 cycle (~0: start a run, followed by the seed), then the commands as doubles
 *   from the stage: uint64 cycle of the measurement, then the measurements as doubles
 * Build: cc -O2 -shared -fPIC -o udp_stage.so udp_stage.c   (stageid_backend.h is installed with stageid) */
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "stageid_backend.h"

enum { CHANNELS = 64 };
struct datagram {
  uint64_t cycle;
  double values[CHANNELS];
};
struct udp_stage {
  int socket;
  uint32_t actuators, sensors;
  double period_ns;
};

static const char* value_of(const struct stageid_request* request, const char* name, const char* otherwise) {
  for (uint32_t i = 0; i < request->n_keys; ++i)
    if (strcmp(request->keys[i].name, name) == 0) return request->keys[i].value;
  return otherwise;
}

static void* open_stage(const struct stageid_request* request, char* error, size_t error_size) {
  const char* host = value_of(request, "host", "127.0.0.1");
  const char* port = value_of(request, "port", "");
  struct sockaddr_in peer = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(port))};
  if (atoi(port) <= 0 || inet_pton(AF_INET, host, &peer.sin_addr) != 1) {
    snprintf(error, error_size, "host '%s', port '%s': write keys: {host: IPV4, port: NUMBER}", host, port);
    return NULL;
  }
  struct udp_stage* stage = calloc(1, sizeof *stage);
  const struct timeval patience = {.tv_sec = 1};
  stage->socket = socket(AF_INET, SOCK_DGRAM, 0);
  stage->actuators = request->n_actuators;
  stage->sensors = request->n_sensors;
  stage->period_ns = 1e9 / request->sample_rate_hz;
  setsockopt(stage->socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  connect(stage->socket, (struct sockaddr*)&peer, sizeof peer);
  return stage;
}

static void describe(void* self, struct stageid_description* description) {
  (void)self;
  description->virtual_time = 1; /* the sample counter of the peer is the clock */
}

/* Sends one datagram and waits for the measurement of cycle `wanted`; older ones are discarded. */
static int ask(struct udp_stage* stage, struct datagram* out, uint32_t values, uint64_t wanted,
               struct stageid_sample* sample) {
  struct datagram in;
  const ssize_t expected = (ssize_t)(sizeof in.cycle + stage->sensors * sizeof(double));
  if (send(stage->socket, out, sizeof out->cycle + values * sizeof(double), 0) < 0) return STAGEID_LINK_DOWN;
  do {
    if (recv(stage->socket, &in, sizeof in, 0) != expected) return STAGEID_LINK_DOWN;
  } while (in.cycle < wanted);
  memcpy(sample->y, in.values, stage->sensors * sizeof(double));
  sample->valid = ~(uint64_t)0 >> (64 - stage->sensors);
  sample->t_sample_ns = sample->t_receive_ns = (int64_t)((double)wanted * stage->period_ns);
  return in.cycle == wanted ? STAGEID_OK : STAGEID_FAULT;
}

static int start(void* self, uint64_t run_seed, struct stageid_sample* first, char* error, size_t error_size) {
  struct datagram out = {.cycle = ~(uint64_t)0};
  memcpy(out.values, &run_seed, sizeof run_seed);
  if (ask(self, &out, 1, 0, first) == STAGEID_OK) return 0;
  snprintf(error, error_size, "the stage does not answer; check its power supply and the port");
  return 1;
}

static int exchange(void* self, uint64_t cycle, const double* u, int64_t deadline_ns, struct stageid_sample* next) {
  struct udp_stage* stage = self;
  struct datagram out = {.cycle = cycle};
  (void)deadline_ns;
  memcpy(out.values, u, stage->actuators * sizeof(double));
  return ask(stage, &out, stage->actuators, cycle + 1, next);
}

static void stop(void* self) { /* a datagram without commands sets the force to zero */
  const uint64_t cycle = 0;
  (void)!send(((struct udp_stage*)self)->socket, &cycle, sizeof cycle, 0);
}

static void trouble(void* self, char* text, size_t size) { (void)self, (void)snprintf(text, size, "%s", ""); }
static void close_stage(void* self) { close(((struct udp_stage*)self)->socket), free(self); }

const struct stageid_backend* stageid_get_backend(void) {
  static const struct stageid_backend calls = {STAGEID_BACKEND_VERSION, sizeof calls, open_stage, describe, start,
                                               exchange, stop, trouble, close_stage};
  return &calls;
}
