#pragma once

#include "tests/support/stages/simulated_spec.hpp"

namespace stageid::test {

/// The stage of configs/stage/wafer_stage.yaml, written out so that tests of the libraries need no
/// file and no parser. A test in tests/tools holds the two together.
SimulatedSpec wafer_stage_spec();

/// The same without noise.
SimulatedSpec silent_wafer_stage_spec();

/// Two actuators, one sensor, all in z, and one flexible mode, at 1 kHz: for tests that need few
/// numbers.
SimulatedSpec small_stage_spec();

/// Indices of the 13 z actuators and the 4 z sensors, which come first.
inline constexpr int kZActuators = 13;
inline constexpr int kZSensors = 4;
inline constexpr int kModesInBand = 17;  ///< flexible, out of plane, below 2 kHz

}  // namespace stageid::test
