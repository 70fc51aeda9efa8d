#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace stageid {

/// Limits that are enforced behind every back end. Vectors: one entry a channel; an empty vector
/// means no limit of that kind.
struct StageLimits {
  Eigen::VectorXd actuator_n;            ///< |u|
  Eigen::VectorXd slew_n_s;              ///< |u[n] - u[n-1]| fs
  Eigen::VectorXd thermal_rms_n;         ///< rms of u over an exponential window
  double thermal_time_constant_s = 10.;  ///< of that window
  Eigen::VectorXd position_window_m;     ///< |y|
  double stuck_sensor_s =
      0.0;  ///< a sensor may show one and the same value for so long; 0: for ever
};

enum class LimitKind : std::uint8_t {
  none,
  actuator,
  slew,
  thermal_rms,
  position,
  not_finite,
  stuck_sensor
};
const char* to_string(LimitKind kind) noexcept;

/// The first limit that was hit in a run.
struct LimitViolation {
  LimitKind kind = LimitKind::none;
  int channel = -1;  ///< index of the actuator or sensor
  double value = 0.0;
  double limit = 0.0;
  std::uint64_t cycle = 0;
  bool of_sensor = false;  ///< what `channel` counts
};

}  // namespace stageid
