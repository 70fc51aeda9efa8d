/* A back end for stageid, in C: the door between the measurement loop and any hardware.
 *
 * A shared library exports one function, stageid_get_backend(), and is named in the stage file:
 *
 *   backend: plugin
 *   plugin: {library: ./my_stage.so, keys: {host: 10.0.0.7}}
 *
 * stageid checks limits, records, shows and stops exactly as with its own back ends. All values are in the
 * units of the channels (SI). Functions are called from one thread at a time. Between start() and stop()
 * only exchange() is called, from the loop's thread: it must not allocate, lock or print. */
#ifndef STAGEID_BACKEND_H
#define STAGEID_BACKEND_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A later version only appends members; what is there keeps its meaning. */
#define STAGEID_BACKEND_VERSION 1

struct stageid_key {
  const char* name;
  const char* value;
};

struct stageid_channel {
  const char* name;
  const char* unit;
};

/* What the stage file asks for; valid during open() only. */
struct stageid_request {
  uint32_t version; /* of the program */
  double sample_rate_hz;
  double pace; /* of the clock: 1 is wall time; 0: as fast as possible, in virtual time */
  uint32_t n_actuators;
  uint32_t n_sensors; /* 64 at most */
  uint32_t n_keys;
  const struct stageid_channel* actuators;
  const struct stageid_channel* sensors;
  const struct stageid_key* keys; /* plugin: keys: of the stage file */
};

/* What the back end is; zeros where nothing is known. */
struct stageid_description {
  double maximum_rate_hz;   /* a higher rate is refused before the stage moves */
  double transport_delay_s; /* from command computed to held output changed */
  int32_t virtual_time;     /* not 0: exchange() returns at once, the sample counter is the clock */
};

/* What was measured. `y` has n_sensors entries and is filled in place. */
struct stageid_sample {
  double* y;
  uint64_t valid;       /* bit i: sensor i was measured */
  int64_t t_sample_ns;  /* the instant the sample belongs to, CLOCK_MONOTONIC or virtual */
  int64_t t_receive_ns; /* when it arrived */
};

/* How one exchange ended. */
enum stageid_outcome {
  STAGEID_OK = 0,
  STAGEID_LATE = 1,       /* valid, but after its time: marked */
  STAGEID_INCOMPLETE = 2, /* some sensors are missing, see `valid` */
  STAGEID_STALE = 3,      /* nothing new: the last measurement is held, marked */
  STAGEID_CORRUPT = 4,    /* an answer failed its check */
  STAGEID_LINK_DOWN = 5,  /* ends the run */
  STAGEID_FAULT = 6       /* the stage reports a fault: ends the run */
};

struct stageid_backend {
  uint32_t version; /* STAGEID_BACKEND_VERSION that it was built with */
  uint32_t size;    /* sizeof(struct stageid_backend) */

  /* Connects. NULL: it failed, and `error` holds one line for people that says what to do. */
  void* (*open)(const struct stageid_request* request, char* error, size_t error_size);
  void (*describe)(void* stage, struct stageid_description* description);
  /* Brings the stage to closed-loop-ready standstill and gives y[0]. `run_seed` makes a run repeatable
   * where random numbers are drawn. Not 0: it failed, with `error` as above. */
  int (*start)(void* stage, uint64_t run_seed, struct stageid_sample* first, char* error,
               size_t error_size);
  /* Applies u[n] (n_actuators), waits for the next sample instant and gives y[n+1]. Must return by
   * `deadline_ns` on the clock of t_sample_ns (0: none) with one of stageid_outcome. */
  int (*exchange)(void* stage, uint64_t cycle, const double* u, int64_t deadline_ns,
                  struct stageid_sample* next);
  /* Zero force, disabled. May be called twice, and after any failure. */
  void (*stop)(void* stage);
  /* One line on what went wrong in the last run, or an empty text. */
  void (*trouble)(void* stage, char* text, size_t text_size);
  void (*close)(void* stage);
};

/* The one exported function. The structure lives as long as the library. */
const struct stageid_backend* stageid_get_backend(void);

#ifdef __cplusplus
}
#endif

#endif
