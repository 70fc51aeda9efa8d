#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "estimation/problem/fit_problem.hpp"
#include "estimation/problem/weight_matrices.hpp"

namespace stageid {

class ResidueFactors;

struct IterationResult {
  FitStatus status = FitStatus::iteration_limit;
  std::string message;
  std::vector<double> cost;  ///< the start (with solved numerators) first
  int iterations = 0;
  double deviations = HUGE_VAL;      ///< FitResult::deviations
  double gradient = 1.0;             ///< scaled, see FitOptions::gradient_tolerance
  double end_cost = 0.0;             ///< at the returned parameters
  std::vector<Eigen::Index> frozen;  ///< globals that ended at a bound and are not unknowns
};

/// Improves `beta` in place until the first-order condition holds: solve the numerators, step the denominators and
/// delays by the equations of the method, re-solve, accept only if the cost falls.
/// riv and gn: Levenberg-Marquardt damping; if the refined-IV step does not lower the cost, the Gauss-Newton step is
/// taken, which is a descent direction. sk: its own fixed point, undamped; the iterate of least cost is returned.
IterationResult iterate(const FitProblem& problem, FitParameters& beta, const FitOptions& options);

/// The same for Hermitian weights, starting from all of `beta` (a fit with the diagonal weights): Gauss-Newton on all
/// parameters at once, see JointEquations, damped until the cost falls. The cost is sum vec(E)^H W_k vec(E) / (2N).
/// @pre problem.W is weights.marginal().
IterationResult iterate(const FitProblem& problem, const WeightMatrices& weights,
                        FitParameters& beta, const FitOptions& options);

/// Minimizes the cost over numerators of given ranks (FitOptions::residue_rank and rigid_body_rank), starting from an
/// unconstrained fit `beta`, which is updated with its `factors`. Modes outside the lines represent several modes and
/// remain free.
/// Method: damped Gauss-Newton on denominators, delays and residue factors together. The unconstrained normal matrix
/// is multiplied by the derivatives of the factors from both sides, so an iteration costs as much as an unconstrained
/// one. See docs/theory.md, section 5.
IterationResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                                 ResidueFactors& factors, const FitOptions& options);

/// sum W |G|^2 / (2N): the cost without a model.
double signal_cost(const FitProblem& problem);

}  // namespace stageid
