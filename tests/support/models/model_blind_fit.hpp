#pragma once

#include <string>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test {

/// A fit with default settings, compared with one that started from the truth.
struct BlindFit {
  FitResult blind;
  FitResult from_truth;
  int true_modes = 0;
  int found_modes = 0;
  double excess_cost = 0.0;         ///< of the blind fit over that from the truth
  double seconds = 0.0;             ///< of the blind fit
  bool success = false;             ///< cost within 0.5 % and at most one surplus mode
  std::vector<double> missed_hz;    ///< true modes without an estimate within a half-power width
  std::vector<double> spurious_hz;  ///< estimates without a true mode there
  std::string report() const;       ///< details for the analysis of a failure
};

/// The default of `fit` on the response of a digital loop: exact hold, delay searched and estimated, variance weights,
/// automatic modes, full rigid body. As many peaks of the CMIF as specified by the stage are removed from its start.
BlindFit fit_blind(const RandomStage& stage, int threads);

/// The unmodified iteration of the paper: peaks of the CMIF, numerators of the convex problem, then beta + M^-1 e
/// without damping, on the same weights and with a given delay.
/// @returns whether its cost came within 0.5 % of `wanted` with at most one surplus mode
bool plain_iteration_succeeds(const RandomStage& stage, double wanted, int threads);

}  // namespace stageid::test
