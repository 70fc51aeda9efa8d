#pragma once

#include "estimation/iteration/fit_iteration.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"

namespace stageid {

/// Outcome of a fit with residues of given rank.
struct LowRankResult {
  IterationResult iteration;
  Eigen::Index parameters = 0;     ///< free ones
  std::vector<int> ranks;          ///< per submodel; 0: free
  ParameterCovariance covariance;  ///< see low_rank_covariance(); empty unless requested
};

/// Minimizes the cost over numerators of given ranks (FitOptions::residue_rank and rigid_body_rank), starting from an
/// unconstrained fit `beta`, which is updated. Modes outside the lines represent several modes and remain free.
/// Method: damped Gauss-Newton on denominators, delays and residue factors together. The unconstrained normal matrix
/// is multiplied by the derivatives of the factors from both sides, so an iteration costs as much as an unconstrained
/// one. See docs/theory.md, section 5.
/// @throws std::invalid_argument for a rank that a submodel cannot have
LowRankResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                               const FitOptions& options, const DataNoise& noise);

}  // namespace stageid
