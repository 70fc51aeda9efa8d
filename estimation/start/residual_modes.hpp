#pragma once

#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A mode that the weighted residual asks for.
struct ResidualMode {
  ModeCandidate mode;
  double gain = 0.0;  ///< estimated fall of sum |E|^2 W if it is added
};

/// Places where one more mode would lower the cost most: a matched filter of the weighted residual
/// with modes on a grid of frequencies (beyond the band's ends too) and damping ratios, every
/// numerator free. The gain is divided by the share of the candidate that the model's own functions
/// cannot imitate.
/// @param weights n_c x N   @returns at most `most`, best first, none two closer than their widths
std::vector<ResidualMode> residual_modes(const FrfEstimate& frf, const AdditiveModel& model,
                                         const Eigen::MatrixXd& weights, std::size_t most,
                                         int threads);

}  // namespace stageid
