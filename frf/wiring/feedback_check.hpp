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

/// Properties of the controller that follow from the data alone.
struct FeedbackCheck {
  std::string unchecked;  ///< the missing data; empty: it was checked
  double relative = 0.0;  ///< rms deviation of u - r from F y over all actuators, over u - r
  int experiments = 0;
  std::vector<Eigen::Index> inconsistent;  ///< actuators without a common function of the sensors
  double worst = 0.0;                      ///< `relative` of the worst of these
};

/// Checks whether u - r is one linear function F of the recorded sensors in all experiments, for any F.
///
/// On each line, with more experiments than sensors, F = (U - R) Y^+ leaves E - n_y complex degrees of freedom per
/// actuator. Their power is compared with the scatter over periods of u - r - F y: F test on each line, Fisher's sum
/// over the lines, 1e-4 over all actuators, and 5 % of u - r. F itself, and hence names, signs, scales and timing of
/// the channels, cannot be checked without a controller.
FeedbackCheck check_feedback(const HealthRecord& record);

}  // namespace stageid
