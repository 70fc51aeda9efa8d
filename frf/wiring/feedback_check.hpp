#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "frf/runs/health_record.hpp"

namespace stageid {

/// Of the checks of u against r and y, with or without a known controller: the misfit of an actuator relative to its
/// feedback, and what float32 records and the difference u - r leave of u.
inline constexpr double kLeastMisfit = 0.05;
inline constexpr double kFeedbackRounding = 1e-9;

/// What these checks need.
inline constexpr const char* kNamedExcitation =
    "an excitation that is added at the actuators and has their names";

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

/// An actuator whose record equals an excitation channel times a factor.
struct MappedExcitation {
  Eigen::Index actuator = 0;
  Eigen::Index excitation = 0;
  double factor = 1.0;
};

/// Finds actuators that equal an excitation channel up to a factor, on every line of every period of every experiment,
/// to 1e-5 of their rms. In a closed loop, such a record is the signal before the summation point and does not contain
/// the controller's output. Fed-back noise leaves more; rounding to float32 leaves 1e-7.
std::vector<MappedExcitation> find_mapped_excitation(const HealthRecord& record);

}  // namespace stageid
