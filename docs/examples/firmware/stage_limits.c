#include "stage_limits.h"

#include <math.h>

static void check(enum stage_cause* cause, double value, double limit) {
  if (isnan(value)) *cause = NOT_FINITE;
  else if (fabs(value) > limit && *cause == NO_CAUSE) *cause = LIMIT;
}

enum stage_cause stage_watch(double elapsed_s, double y_m[STAGE_SENSORS]) {
  double next_m[STAGE_SENSORS];
  enum stage_cause cause = NO_CAUSE;
  int i;
  stage_hardware_measure(next_m);
  for (i = 0; i < STAGE_SENSORS; ++i) {
    check(&cause, next_m[i], STAGE_WINDOW_M);
    check(&cause, next_m[i] - y_m[i], STAGE_SPEED_LIMIT_M_S * elapsed_s);
    y_m[i] = next_m[i];
  }
  return cause;
}

enum stage_cause stage_move(const double u_n[STAGE_ACTUATORS], double y_m[STAGE_SENSORS]) {
  enum stage_cause cause = NO_CAUSE;
  int i;
  for (i = 0; i < STAGE_ACTUATORS; ++i) check(&cause, u_n[i], STAGE_FORCE_LIMIT_N);
  if (cause == NO_CAUSE) {
    stage_hardware_apply(u_n);
    return stage_watch(1.0 / STAGE_RATE_HZ, y_m);
  }
  for (i = 0; i < STAGE_SENSORS; ++i) y_m[i] = NAN;
  return cause;
}
