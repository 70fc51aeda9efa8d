/* A stage that moves by the wall clock, with or without setpoints. The seed of the run selects its motion:
 *   1: 20 mm/s, out of the window after 0.25 s;   2: 4 mm at 12 Hz, inside of it, but half again too fast;   others: none.
 * A test in the same process moves it by offset_m. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <string.h>
#include <time.h>

#include "stage_limits.h"

double offset_m;
static double began_s, force_n[STAGE_ACTUATORS];
static uint64_t motion;

static double now_s(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void stage_hardware_start(uint64_t seed) {
  motion = seed;
  began_s = now_s();
  stage_hardware_stop();
}

void stage_hardware_apply(const double u_n[STAGE_ACTUATORS]) { memcpy(force_n, u_n, sizeof force_n); }

void stage_hardware_measure(double y_m[STAGE_SENSORS]) {
  const double t = now_s() - began_s;
  int i;
  for (i = 0; i < STAGE_SENSORS; ++i) {
    y_m[i] = offset_m;
    if (motion == 1) y_m[i] = 20e-3 * t;
    if (motion == 2) y_m[i] = 4e-3 * sin(24.0 * 3.14159265 * t);
  }
}

void stage_hardware_stop(void) { memset(force_n, 0, sizeof force_n); }

double stage_hardware_force_n(int actuator) { return force_n[actuator]; }
