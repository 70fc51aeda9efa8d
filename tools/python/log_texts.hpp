#pragma once

namespace stageid {

// Texts of help(stageid) on logs.

inline constexpr const char* kLogDoc =
    R"(The samples of an experiment: a sequence of runs, each with its realization and experiment.

len(log) is the number of runs; log[i] reads one. Samples of a file (read_log) are read on access.)";

inline constexpr const char* kLogInitDoc =
    R"(A log made of arrays: M realizations of E experiments of S samples.

r [M, E, P, n_r]      one period of the excitation per run, in the unit of the actuators
u [M, E, S, n_u]      actuators, e.g. in N; S is transient_periods plus at least one period, each of P samples
y [M, E, S, n_y]      sensors, e.g. in m
sample_rate_hz        Hz
transient_periods     periods to discard at the beginning of every run
excitation, actuators, sensors    names; default those of the actuators (n_r = n_u) or r1 ..., u1 ..., y1 ...
actuator_units, sensor_units      one per channel
marked [M, E, S]      nonzero: the sample is not used

u and y are not copied if they are float64 with adjacent channels per sample (C order and slices of it); otherwise
they are copied once. Do not change them while an estimate runs.
Raises RequestError if shapes do not match, FormatError if runs are not whole periods.)";

inline constexpr const char* kRunDoc =
    R"(Run i as a dict: realization, experiment (from 0), complete, excitation [P, n_r], actuators [S, n_u],
sensors [S, n_y] (float64, SI, column-major), marked [S] (uint8).

Raises IndexError, or FormatError if samples are damaged.)";

inline constexpr const char* kArraysDoc =
    R"(All runs as (r [M, E, P, n_r], u [M, E, S, n_u], y [M, E, S, n_y]), float64.

For a log in memory, these are its own arrays, not copies. Raises RequestError if the runs are incomplete or differ in
length.)";

inline constexpr const char* kReadLogDoc =
    R"(Opens a log (.slog or HDF5). Samples are read on access.

Raises FileError, FormatError.)";

inline constexpr const char* kSimulateDoc =
    R"(Runs an experiment file (.yaml) on its simulated stage, in virtual time and in memory.

The samples are those of `stageid run CONFIG --backend sim --pace 0`. Returns a Log; its arrays() are views of the
recorded rows, not copies. Raises FileError, FormatError, or StageError if a limit or fault ended the run.)";

}  // namespace stageid
