#pragma once

#include <string>

#include "acquisition/prediction/closed_loop_prediction.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// Result of the stability check before the loop is closed.
struct LoopCheck {
  std::string problem;  ///< why the controller does not hold the plant; empty: none found
  std::string doubt;    ///< poor margin, or why it could not be tested; empty: no doubt
  double largest_sensitivity = 0.0;  ///< of the characteristic loci; 0: not tested
};

/// For the plant of a stage file: eigenvalues of the exact sampled loop.
LoopCheck check_loop(const StageConfig& stage);

/// For an experiment: by the plant of its stage file or, with a level within limits, by the prior, whose response must
/// not encircle the critical point (Nyquist).
/// @throws FileError, FormatError if the prior cannot be read
LoopCheck check_loop(const ExperimentConfig& config);

/// To be called before the loop is closed; warns of a doubt. @throws FormatError if the check found a problem.
void require_stable_loop(const ExperimentConfig& config, const Console& console);
void require_stable_loop(const StageConfig& stage, const Console& console);

/// The signals of the stage during the experiment; empty if the multisines were designed within limits, from a prior.
/// Warns if they cannot be predicted, see why_unpredictable().
DesignPrediction predict_signals(const ExperimentConfig& config, const ExperimentPlan& plan,
                                 const Console& console);

/// To be called before the experiment is performed; if `forced`, only warns of every limit that would be exceeded.
/// @throws FormatError naming the first one, and the number of others.
void require_within_limits(const ExperimentConfig& config, const DesignPrediction& prediction,
                           bool forced, const Console& console);

}  // namespace stageid
