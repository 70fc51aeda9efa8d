#pragma once

#include "estimation/fit_iteration.hpp"
#include "estimation/parameter_covariance.hpp"
#include "estimation/residue_form.hpp"

namespace stageid {

/// The outcome of a fit with residues of given rank.
struct LowRankResult {
  IterationResult iteration;
  Eigen::Index parameters = 0;  ///< free ones
  std::vector<int> ranks;       ///< of every submodel; 0: free
  /// Covariance of denominators and delays and of the response, for maximum likelihood weights or, if
  /// these are not known to be right, scaled by the residual. Empty where the system is singular.
  ParameterCovariance covariance;
};

/// Minimizes the cost over numerators whose ranks are given (FitOptions::residue_rank and
/// rigid_body_rank; modes beside the lines, which stand for several, stay free), from an unconstrained
/// fit `beta`, and leaves the model there: damped
/// Gauss-Newton on denominators, delays and residue factors together. The unconstrained normal
/// matrix is multiplied by the factors' derivatives from both sides, so that an iteration costs what
/// an unconstrained one does. Source: facts.md section 11.
/// @throws std::invalid_argument for a rank that a submodel cannot have
LowRankResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                               const FitOptions& options, bool likelihood);

}  // namespace stageid
