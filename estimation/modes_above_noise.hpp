#pragma once

#include <string>
#include <vector>

#include "estimation/additive_model.hpp"
#include "estimation/fit_options.hpp"
#include "estimation/model_structure.hpp"

namespace stageid {

/// Of very many modes that are asked for the data show some not at all: free, their poles settle on the
/// largest noise peaks, which lowers the cost and leads away from the truth. Keeps of `placed` what stands
/// out of the noise, searches the residual for what else does (rank_one_modes()), and gives the rest of
/// `wanted` as modes whose poles are held where they were placed.
///
/// Noise is what the residual shows. A mode is above it if noise alone would reach its removal cost on less than
/// one of the lines; a mode is added if noise would reach its gain at less than one of all places.
/// @param placed a fit of the numerators, poles where they were placed
/// @param quick weights and how to fit on the way   @param decisions what was done is added
AdditiveModel modes_above_noise(const FrfEstimate& frf, const ModelStructure& structure,
                                const FitResult& placed, const FitOptions& quick, int wanted,
                                std::vector<std::string>& decisions);

}  // namespace stageid
