#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "frf/runs/health_record.hpp"

namespace stageid {

/// Of the checks of u against r and y, with or without a known controller: the misfit of an actuator relative to its
/// feedback, its significance over all actuators, and what float32 records and the difference u - r leave of u.
inline constexpr double kLeastMisfit = 0.05;
inline constexpr double kFeedbackSignificance = 1e-4;
inline constexpr double kFeedbackRounding = 1e-9;

/// What the data alone tell of the controller.
struct FeedbackCheck {
  std::string unchecked;  ///< what is missing; empty: it was checked
  double relative = 0.0;  ///< rms of what u - r is beside F y, of u - r, over all actuators
  int experiments = 0;
  std::vector<Eigen::Index> inconsistent;  ///< actuators that are no one function of the sensors
  double worst = 0.0;                      ///< `relative` of the worst of these
};

/// Is u - r one linear function F of the recorded sensors in all experiments, whatever F is?
///
/// On each line, with more experiments than sensors, F = (U - R) Y^+ leaves E - n_y complex degrees of
/// freedom an actuator. Their power against the scatter over periods of u - r - F y: F test on each line,
/// Fisher's sum over the lines, 1e-4 over all actuators, and 5 % of u - r. What F is, and with it names,
/// signs, scales and timing of the channels, this cannot tell.
FeedbackCheck check_feedback(const HealthRecord& record);

}  // namespace stageid
