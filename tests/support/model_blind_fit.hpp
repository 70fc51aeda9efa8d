#pragma once

#include <string>
#include <vector>

#include "estimation/fit_additive_model.hpp"
#include "tests/support/random_stage.hpp"

namespace stageid::test {

/// A fit that knew nothing, beside one that started from the truth.
struct BlindFit {
  FitResult blind;
  FitResult from_truth;
  int true_modes = 0;
  int found_modes = 0;
  double excess_cost = 0.0;         ///< of the blind fit over that from the truth
  double seconds = 0.0;             ///< of the blind fit
  bool success = false;             ///< cost within 0.5 % and at most one mode too many
  std::vector<double> missed_hz;    ///< true modes without an estimate within a half-power width
  std::vector<double> spurious_hz;  ///< estimates without a true mode there
  std::string report() const;       ///< everything that one wants to see of a failure
};

/// What `fit` does by default on the response of a digital loop: exact hold, delay searched and
/// estimated, variance weights, modes found by itself, full rigid body.
BlindFit fit_blind(const RandomStage& stage, int threads);

}  // namespace stageid::test
