#pragma once

#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "excitation/threads/team.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Poles that start beyond the lines start within these factors of their lowest and highest frequency.
inline constexpr double kBelowBand = 0.5;
inline constexpr double kAboveBand = 1.8;

/// A mode proposed by the weighted residual.
struct ProposedMode {
  ModeCandidate mode;
  double gain = 0.0;  ///< estimated decrease of sum |E|^2 W if it is added
};

/// Frequencies at which one more mode would lower the cost most: a matched filter of the weighted residual with modes
/// on a grid of frequencies (extending beyond the band) and damping ratios, every numerator free. The gain is divided
/// by the share of the candidate that the functions of the model cannot imitate.
/// @param weights n_c x N   @returns at most `most`, best first, no two closer than their widths or on the same side of the lines
std::vector<ProposedMode> proposed_modes(const FrfEstimate& frf, const AdditiveModel& model,
                                         const Eigen::MatrixXd& weights, std::size_t most,
                                         const Workers& workers);

}  // namespace stageid
