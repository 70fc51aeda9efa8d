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
  double end_cost = 0.0;             ///< at the returned parameters
  std::vector<Eigen::Index> frozen;  ///< globals that ended at a bound and are not unknowns

  /// @returns false: the iteration does not go on
  bool end(FitStatus why, std::string reason);
  /// The end if no step lowers the cost: at rounding level, or stalled. @param detail end of the message
  bool end_without_step(const std::string& detail = {});
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

/// If no step lowers the cost, the cost is at rounding level if the stationary point is at most this many standard
/// deviations away.
inline constexpr double kRoundingDeviations = 0.05;

/// Part of the weighted power of the data: if no step lowers a residual below it, the residual is rounding, not a
/// stalled fit. 1e-10 of the amplitude, the accuracy of coinciding poles in double precision.
inline constexpr double kNothingLeft = 1e-20;

/// max_i |e_i| / sqrt(M_ii squares), 0 to 1: the cosine between the residual and the effect of a parameter.
/// @param squares sum W |E|^2
double scaled_gradient(const Eigen::MatrixXd& M, const Eigen::VectorXd& e,
                       const std::vector<Eigen::Index>& frozen, double squares);

/// sum W |G|^2 / (2N): the cost without a model.
double signal_cost(const FitProblem& problem);

/// With larger damping, no step is tried.
inline constexpr double kLargestLevenberg = 1e8;

}  // namespace stageid
