/* The stage itself, the same behind every bus: its description, its hardware, its limits. */
#ifndef STAGE_LIMITS_H
#define STAGE_LIMITS_H

#include <stdint.h>

/* Rate, names, units and order are those of the stage file of the host. The scales are powers of
 * two; 2^31 of them cover at least twice the limit. */
#define STAGE_RATE_HZ 200.0f
#define STAGE_CHANNELS "z1 N\nz2 N\np1 m\np2 m\n"
enum { STAGE_ACTUATORS = 2, STAGE_SENSORS = 2 };
#define STAGE_FORCE_LIMIT_N 10.0
#define STAGE_FORCE_SCALE_N (1.0 / 67108864.0) /* 2^-26: 32 N */
#define STAGE_WINDOW_M 5e-3
#define STAGE_POSITION_SCALE_M (1.0 / 137438953472.0) /* 2^-37: 16 mm */
#define STAGE_SPEED_LIMIT_M_S 0.2

enum stage_state { SWITCH_ON_DISABLED = 1, OPERATION_ENABLED = 4, MEASURING = 5, FAULT = 8 };
enum stage_cause { NO_CAUSE = 0, HOST_SILENT = 1, LIMIT = 2, NOT_FINITE = 3, INTERLOCK = 4, HEARTBEAT_LOST = 9 };

/* The hardware; stage_plant.c is a simulated one. */
/* Amplifiers on, forces zero. `seed`: for the noise of a simulated stage. */
void stage_hardware_start(uint64_t seed);
/* Waits for the next tick of the sample clock, then applies u[n]. A simulated stage moves by one sample instead. */
void stage_hardware_apply(const double u_n[STAGE_ACTUATORS]);
void stage_hardware_measure(double y_m[STAGE_SENSORS]); /* at once; NaN: no value */
void stage_hardware_stop(void);                         /* forces zero */
double stage_hardware_force_n(int actuator);            /* the one that acts now */

/* The limits. `y_m` are the last positions and become the new ones. A cause other than NO_CAUSE: stop the stage. */
/* u[n] -> y[n+1]. A force beyond its limit is not applied, and not clamped either: y is then NaN. */
enum stage_cause stage_move(const double u_n[STAGE_ACTUATORS], double y_m[STAGE_SENSORS]);
/* Without a setpoint: once per STAGE_WATCH_US, `elapsed_s` after y. In less time, noise would look like speed. */
enum { STAGE_WATCH_US = 1000 };
enum stage_cause stage_watch(double elapsed_s, double y_m[STAGE_SENSORS]);

#endif
