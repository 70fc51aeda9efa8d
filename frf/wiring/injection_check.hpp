#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/runs/health_record.hpp"

namespace stageid {

/// An actuator whose record is an excitation channel times a factor.
struct MappedExcitation {
  Eigen::Index actuator = 0;
  Eigen::Index excitation = 0;
  double factor = 1.0;
};

/// Which actuators are an excitation channel, but for a factor, on every line of every period of every
/// experiment, to 1e-5 of their rms: in a closed loop the record is that of the signal before the sum, and
/// holds nothing of the controller. Noise that is fed back leaves more; rounding to float32 leaves 1e-7.
std::vector<MappedExcitation> find_mapped_excitation(const HealthRecord& record);

/// For every excitation channel the actuator of its name, or -1.
std::vector<Eigen::Index> actuators_of_excitation(const LogInfo& info);

}  // namespace stageid
