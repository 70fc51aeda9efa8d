#pragma once

#include <vector>

#include "estimation/model/model_structure.hpp"
#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// The start of a search: hold, known delays, the submodels besides the modes, and these modes.
/// @param known a model whose delays are used, if it has submodels
AdditiveModel search_start(const FrfEstimate& frf, const ModelStructure& structure,
                           const FitOptions& options, const AdditiveModel& known,
                           const std::vector<ModeCandidate>& modes);

/// A mode where the CMIF is largest.
ModeCandidate strongest_peak(const FrfEstimate& frf);

}  // namespace stageid
