/* Interface in C between the measurement loop of stageid and the back end of any hardware.
 *
 * A shared library exports one function, stageid_get_backend(), and is named in the stage file:
 *
 *   backend: plugin
 *   plugin: {library: ./my_stage.so, keys: {host: 10.0.0.7}}
 *
 * stageid checks limits, records and stops as with its own back ends. All values are in the units of the
 * channels (SI). Functions are called from one thread at a time. Between start() and stop() only exchange() is
 * called, from the loop's thread: it must not allocate, lock or print. */
#ifndef STAGEID_BACKEND_H
#define STAGEID_BACKEND_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Later versions only append members; existing ones keep their meaning. */
#define STAGEID_BACKEND_VERSION 1

struct stageid_key {
  const char* name;
  const char* value;
};

struct stageid_channel {
  const char* name;
  const char* unit;
};

/* Request from the stage file; valid during open() only. */
struct stageid_request {
  uint32_t version; /* of the program */
  double sample_rate_hz;
  double pace; /* of the clock: 1 is wall time; 0: as fast as possible, in virtual time */
  uint32_t n_actuators;
  uint32_t n_sensors; /* 64 at most */
  uint32_t n_keys;
  const struct stageid_channel* actuators;
  const struct stageid_channel* sensors;
  const struct stageid_key* keys; /* `plugin: keys:` of the stage file */
};

/* Properties of the back end; zeros if unknown. */
struct stageid_description {
  double maximum_rate_hz;   /* a higher rate is refused before the stage moves */
  double transport_delay_s; /* from computed command to changed output */
  int32_t virtual_time;     /* not 0: exchange() returns at once, the sample counter is the clock */
};

/* One measurement. `y` has n_sensors entries and is filled in place. */
struct stageid_sample {
  double* y;
  uint64_t valid;       /* bit i: sensor i was measured */
  int64_t t_sample_ns;  /* the sample instant, CLOCK_MONOTONIC or virtual */
  int64_t t_receive_ns; /* time of arrival */
};

/* Result of an exchange. */
enum stageid_outcome {
  STAGEID_OK = 0,
  STAGEID_LATE = 1,       /* valid, but after the deadline: marked */
  STAGEID_INCOMPLETE = 2, /* some sensors are missing, see `valid` */
  STAGEID_STALE = 3,      /* nothing new: the last measurement is held, marked */
  STAGEID_CORRUPT = 4,    /* an answer failed its check */
  STAGEID_LINK_DOWN = 5,  /* ends the run */
  STAGEID_FAULT = 6       /* the stage reports a fault: ends the run */
};

struct stageid_backend {
  uint32_t version; /* STAGEID_BACKEND_VERSION of its header */
  uint32_t size;    /* sizeof(struct stageid_backend) */

  /* Connects. Returns NULL on failure, with one line in `error`: the problem and its remedy. */
  void* (*open)(const struct stageid_request* request, char* error, size_t error_size);
  void (*describe)(void* stage, struct stageid_description* description);
  /* Brings the stage to a standstill ready for closed loop and returns y[0]. `run_seed` makes random numbers
   * repeatable. Returns nonzero on failure, with `error` as above. */
  int (*start)(void* stage, uint64_t run_seed, struct stageid_sample* first, char* error,
               size_t error_size);
  /* Applies u[n] (n_actuators), waits for the next sample instant and returns y[n+1]. Must return one of
   * stageid_outcome by `deadline_ns` on the clock of t_sample_ns (0: none). */
  int (*exchange)(void* stage, uint64_t cycle, const double* u, int64_t deadline_ns,
                  struct stageid_sample* next);
  /* Zero force, disabled. May be called twice, and after any failure. */
  void (*stop)(void* stage);
  /* Describes the problem of the last run in one line, or writes an empty text. */
  void (*trouble)(void* stage, char* text, size_t text_size);
  void (*close)(void* stage);
};

/* The only exported function. The structure must live as long as the library. */
const struct stageid_backend* stageid_get_backend(void);

#ifdef __cplusplus
}
#endif

#endif
