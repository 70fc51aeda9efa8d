#pragma once

#include "estimation/iteration/fit_iteration.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"

namespace stageid {

/// The outcome of a fit with residues of given rank.
struct LowRankResult {
  IterationResult iteration;
  Eigen::Index parameters = 0;     ///< free ones
  std::vector<int> ranks;          ///< of every submodel; 0: free
  ParameterCovariance covariance;  ///< see low_rank_covariance(); empty unless asked for
};

/// Minimizes the cost over numerators whose ranks are given (FitOptions::residue_rank and
/// rigid_body_rank; modes beside the lines, which stand for several, stay free), from an unconstrained
/// fit `beta`, and leaves the model there: damped
/// Gauss-Newton on denominators, delays and residue factors together. The unconstrained normal
/// matrix is multiplied by the factors' derivatives from both sides, so that an iteration costs what
/// an unconstrained one does. Source: facts.md section 11.
/// @throws std::invalid_argument for a rank that a submodel cannot have
LowRankResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                               const FitOptions& options, const DataNoise& noise);

}  // namespace stageid
