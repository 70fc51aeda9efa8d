#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/runs/health_record.hpp"

namespace stageid {

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

/// For every excitation channel the actuator of its name, or -1.
std::vector<Eigen::Index> actuators_of_excitation(const LogInfo& info);

}  // namespace stageid
