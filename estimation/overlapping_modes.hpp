#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "estimation/additive_model.hpp"

namespace stageid {

/// Searched modes whose natural frequencies are less apart than the larger half-power width, the nearest
/// pair in that measure first. @returns indices of submodels, the lower one first
std::vector<std::pair<std::size_t, std::size_t>> overlapping_modes(const AdditiveModel& model);

}  // namespace stageid
