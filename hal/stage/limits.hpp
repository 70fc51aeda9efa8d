#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>

#include "hal/stage/stage.hpp"

namespace stageid {

/// The rigid motion of a stage as its controller assumes it, without identification. Empty matrices: unknown.
struct RigidMotion {
  Eigen::MatrixXd acceleration_per_n;      ///< sensors x actuators, 1/kg
  Eigen::MatrixXd force_per_acceleration;  ///< actuators x sensors, kg; of the braked axes
  Eigen::MatrixXd contradiction;  ///< sensors x sensors: part of y that no rigid motion explains
  double bandwidth_rad_s = 0.0;   ///< of the slowest axis

  bool known() const noexcept { return acceleration_per_n.size() > 0; }
};

/// The bound of what has no limit.
inline constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// Limits that are enforced for every back end. Vectors: one entry per channel; an empty vector
/// means no limit of that kind.
struct StageLimits {
  Eigen::VectorXd actuator_n;            ///< |u|
  Eigen::VectorXd slew_n_s;              ///< |u[n] - u[n-1]| fs
  Eigen::VectorXd thermal_rms_n;         ///< rms of u over an exponential window
  double thermal_time_constant_s = 10.;  ///< of that window
  Eigen::VectorXd position_window_m;     ///< |y|
  Eigen::VectorXd hard_window_m;         ///< |y| at which forces are cut; empty: twice the window
  Eigen::VectorXd speed_m_s;             ///< at each sensor
  Eigen::VectorXd deviation_m;           ///< from the predicted motion; empty: half the window
  double stuck_sensor_s = 0.0;  ///< longest time that a sensor may repeat one value; 0: unlimited
  RigidMotion motion;           ///< for predictions and for the brake
};

/// The limits with an entry for every channel: a missing vector is replaced by its default, or by kUnlimited. Without a
/// known motion nothing is predicted, so deviation_m is kUnlimited.
/// @throws std::invalid_argument if a vector or matrix has the wrong size, or a value is out of range
StageLimits complete_limits(const StageLimits& limits, const StageInfo& info);

enum class LimitKind : std::uint8_t {
  none,
  actuator,
  slew,
  thermal_rms,
  position,
  not_finite,
  stuck_sensor,
  sensor_jump,
  deviation,
  contradiction,
  speed,
  stopping_distance,
  hard_position
};

/// The first limit that was exceeded in a run.
struct LimitViolation {
  LimitKind kind = LimitKind::none;
  int channel = -1;  ///< index of the actuator or sensor
  double value = 0.0;
  double limit = 0.0;
  std::uint64_t cycle = 0;
  bool of_sensor = false;  ///< whether `channel` is a sensor
};

}  // namespace stageid
