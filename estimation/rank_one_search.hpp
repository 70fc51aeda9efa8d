#pragma once

#include <vector>

#include "estimation/cmif.hpp"
#include "estimation/fit_problem.hpp"

namespace stageid {

/// A place where the residual of a fit shows a mode.
struct RankOneMode {
  ModeCandidate mode;
  double gain = 0.0;  ///< fall of sum W |E|^2 by its residues, one of the mode's functions alone
};

/// Modes of one damping ratio that residues of rank one, phi psi^T, ask for, on a grid of a third of
/// their half-power width between the first line and the last: far weaker ones stand out of noise than
/// with free residues, n_y + n_u - 1 numbers instead of n_y n_u. What the fit's own functions imitate is
/// taken out in every channel.
/// @param groups the functions at the fit, `E` its residual, numerators solved
std::vector<RankOneMode> rank_one_modes(const FitProblem& problem,
                                        const std::vector<BasisGroup>& groups, const Residual& E,
                                        double damping_ratio);

}  // namespace stageid
