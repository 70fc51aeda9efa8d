#pragma once

#include <string>

#include "tools/experiment/experiment_config.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// What is known of the closed loop before it is closed.
struct LoopCheck {
  std::string problem;  ///< it does not hold the plant; empty: it does, or nobody knows
  std::string doubt;    ///< poor margin, or why it could not be tested; empty: none
  double largest_sensitivity = 0.0;  ///< of the characteristic loci; 0: not tested
};

/// Of the plant of a stage file: eigenvalues of the exact sampled loop.
LoopCheck check_loop(const WaferStageSpec& stage);

/// Of an experiment: by the plant of its stage file or, with a level within limits, by the prior, whose response is
/// counted around the critical point (Nyquist).
/// @throws FileError, FormatError if the prior cannot be read
LoopCheck check_loop(const ExperimentConfig& config);

/// Before the loop is closed: warns of a doubt. @throws FormatError if the check found a problem.
void require_stable_loop(const ExperimentConfig& config, const Console& console);
void require_stable_loop(const StageConfig& stage, const Console& console);

}  // namespace stageid
