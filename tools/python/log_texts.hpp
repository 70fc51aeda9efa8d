#pragma once

namespace stageid {

// What help(stageid) tells of logs.

inline constexpr const char* kLogDoc =
    R"(The samples of an experiment: runs, each of one realization and one experiment.

len(log) runs; log[i] reads one. A log of a file (read_log) stays there until it is read.)";

inline constexpr const char* kLogInitDoc =
    R"(A log over arrays; M realizations of E experiments of S samples.

r [M, E, P, n_r]      one period of the excitation of every run, unit of the actuators
u [M, E, S, n_u]      actuators, e.g. N; S is transient_periods and one or more periods of P samples
y [M, E, S, n_y]      sensors, e.g. m
sample_rate_hz        Hz
transient_periods     periods at the beginning of every run that are not used
excitation, actuators, sensors    names; else those of the actuators (n_r = n_u) or r1 ..., u1 ..., y1 ...
actuator_units, sensor_units      one a channel
marked [M, E, S]      nonzero: do not use this sample

u and y are not copied if they are float64 with the channels of a sample next to each other (C order and
slices of it), else once. They must not be changed while an estimate runs.
Raises RequestError where shapes do not fit, FormatError where runs are not whole periods.)";

inline constexpr const char* kRunDoc =
    R"(Run i as a dict: realization, experiment (from 0), complete, excitation [P, n_r], actuators [S, n_u],
sensors [S, n_y] (float64, SI, column-major), marked [S] (uint8).

Raises IndexError, FormatError where samples are damaged.)";

inline constexpr const char* kArraysDoc =
    R"(All runs as (r [M, E, P, n_r], u [M, E, S, n_u], y [M, E, S, n_y]), float64.

Of a log in memory its own arrays, not copied. Raises RequestError if the runs are not complete or of
different lengths.)";

inline constexpr const char* kReadLogDoc =
    R"(Opens a log, .slog or HDF5. Samples are read when they are asked for.

Raises FileError, FormatError.)";

inline constexpr const char* kSimulateDoc =
    R"(Performs an experiment file (.yaml) on its simulated stage, in virtual time and in memory.

The same samples as `stageid run CONFIG --backend sim --pace 0`. Returns a Log; its arrays() are views of the
recorded rows, not copied. Raises FileError, FormatError, StageError if a limit or fault ended it.)";

}  // namespace stageid
