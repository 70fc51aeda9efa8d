/* A simulated stage in place of converters and amplifiers: modes on springs,
 *   q'' + 2 z w q' + w^2 q = sum shape u,   y = sum shape q,
 * exactly discretized for a force that is constant over one sample. */
#include <math.h>
#include <string.h>

#include "stage_limits.h"

enum { MODES = 5 };
static const struct {
  double hz, damping, actuator[STAGE_ACTUATORS], sensor[STAGE_SENSORS]; /* shapes in kg^-1/2 */
} modes[MODES] = {
    {1.0, 0.2, {0.5, 0.5}, {0.5, 0.5}},      {1.3, 0.2, {0.9, -0.9}, {0.9, -0.9}},
    {18.0, 0.02, {0.5, 0.4}, {0.6, 0.3}},     {31.0, 0.015, {0.3, -0.5}, {-0.4, 0.5}},
    {47.0, 0.01, {0.4, 0.3}, {0.3, -0.4}},
};
static double a[MODES][2][2], b[MODES][2]; /* of displacement and velocity per mode */
static double x[MODES][2], position_m[STAGE_SENSORS], force_n[STAGE_ACTUATORS];
static uint64_t random_state;

/* Uniform noise. Without any, the rounding to counts would repeat in every period and look like distortion. */
static double noise_m(void) {
  random_state = random_state * 6364136223846793005u + 1442695040888963407u;
  return 1e-7 * ((double)(random_state >> 32) / 4294967296.0 - 0.5);
}

static void discretize(int m) {
  const double t = 1.0 / STAGE_RATE_HZ, w = 8.0 * atan(1.0) * modes[m].hz, s = modes[m].damping * w;
  const double wd = sqrt(w * w - s * s), e = exp(-s * t), c = e * cos(wd * t), d = e * sin(wd * t) / wd;
  a[m][0][0] = c + s * d;
  a[m][0][1] = d;
  a[m][1][0] = -w * w * d;
  a[m][1][1] = c - s * d;
  b[m][0] = (1.0 - a[m][0][0]) / (w * w);
  b[m][1] = d;
}

static void sample(void) {
  int i, m;
  for (i = 0; i < STAGE_SENSORS; ++i)
    for (position_m[i] = noise_m(), m = 0; m < MODES; ++m) position_m[i] += modes[m].sensor[i] * x[m][0];
}

void stage_hardware_start(uint64_t seed) {
  int m;
  for (m = 0; m < MODES; ++m) discretize(m);
  memset(x, 0, sizeof x);
  random_state = seed;
  stage_hardware_stop();
  sample();
}

void stage_hardware_apply(const double u_n[STAGE_ACTUATORS]) {
  int i, m;
  memcpy(force_n, u_n, sizeof force_n);
  for (m = 0; m < MODES; ++m) {
    const double q = x[m][0], v = x[m][1];
    double f = 0.0;
    for (i = 0; i < STAGE_ACTUATORS; ++i) f += modes[m].actuator[i] * force_n[i];
    x[m][0] = a[m][0][0] * q + a[m][0][1] * v + b[m][0] * f;
    x[m][1] = a[m][1][0] * q + a[m][1][1] * v + b[m][1] * f;
  }
  sample();
}

/* Setpoints are the clock of this stage: it does not move between them. */
void stage_hardware_measure(double y_m[STAGE_SENSORS]) { memcpy(y_m, position_m, sizeof position_m); }

void stage_hardware_stop(void) { memset(force_n, 0, sizeof force_n); }

double stage_hardware_force_n(int actuator) { return force_n[actuator]; }
