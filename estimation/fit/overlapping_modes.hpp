#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// Pairs of searched modes whose natural frequencies differ by less than the larger half-power width, the nearest pair
/// (in that measure) first. @returns indices of submodels, the lower one first
std::vector<std::pair<std::size_t, std::size_t>> overlapping_modes(const AdditiveModel& model);

/// `model` with modes `i` and `j` replaced by one at the geometric means of frequency and damping, weighted by the
/// inverse squares of their dampings: a narrow mode determines a frequency more precisely. The numerators must
/// be re-solved. @pre both are modes, i < j
AdditiveModel with_one_of(const AdditiveModel& model, std::size_t i, std::size_t j);

}  // namespace stageid
