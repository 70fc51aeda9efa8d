#pragma once

#include <string>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// The channels whose delay differs from the median of the other inputs or outputs by more than five standard
/// deviations, as a finding; empty if there are none. @pre model.sample_rate_hz > 0
std::string late_channels(const AdditiveModel& model);

}  // namespace stageid
