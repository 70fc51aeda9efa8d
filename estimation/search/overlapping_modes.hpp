#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// Searched modes whose natural frequencies are less apart than the larger half-power width, the nearest
/// pair in that measure first. @returns indices of submodels, the lower one first
std::vector<std::pair<std::size_t, std::size_t>> overlapping_modes(const AdditiveModel& model);

/// `model` with mode `i` of a pair between the two, by the geometric means of frequency and damping, and without mode
/// `j`. The numerators of the one that is left are to be solved anew. @pre both are modes, i < j
AdditiveModel with_one_of(const AdditiveModel& model, std::size_t i, std::size_t j);

}  // namespace stageid
