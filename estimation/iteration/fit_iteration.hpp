#pragma once

#include <string>
#include <vector>

#include "estimation/problem/fit_problem.hpp"
#include "estimation/problem/weight_matrices.hpp"

namespace stageid {

struct IterationResult {
  FitStatus status = FitStatus::iteration_limit;
  std::string message;
  std::vector<double> cost;  ///< the start (numerators solved) first
  int iterations = 0;
  double end_cost = 0.0;             ///< at the returned parameters
  std::vector<Eigen::Index> frozen;  ///< globals that ended at a bound: no longer unknowns
};

/// Improves `beta` in place until the first-order condition holds: solve the numerators, step the
/// denominators and delays by the method's equations, re-solve, accept only what lowers the cost.
/// riv and gn: Levenberg-Marquardt damping; where the refined-IV step does not lower the cost, the
/// Gauss-Newton one is taken, which is a descent direction. sk: its own fixed point, undamped; the
/// iterate of least cost is returned.
IterationResult iterate(const FitProblem& problem, FitParameters& beta, const FitOptions& options);

/// The same for Hermitian weights, from all of `beta` (a fit with the diagonal weights): Gauss-Newton
/// on all parameters at once, see JointEquations, damped until the cost falls. The cost is the true
/// one, sum vec(E)^H W_k vec(E) / (2N). @pre problem.W is weights.marginal().
IterationResult iterate(const FitProblem& problem, const WeightMatrices& weights,
                        FitParameters& beta, const FitOptions& options);

/// Where no step lowers the cost, it is at rounding if the stationary point is so many standard
/// deviations away.
inline constexpr double kRoundingDeviations = 0.05;

/// Part of the data's weighted power below which a residual that no step lowers is rounding, not a
/// fit that got stuck: 1e-10 of the amplitude, what coinciding poles leave of double precision.
inline constexpr double kNothingLeft = 1e-20;

/// sum W |G|^2 / (2N): what the cost is without a model.
double signal_cost(const FitProblem& problem);

/// Damping beyond which no step is worth trying.
inline constexpr double kLargestLevenberg = 1e8;

/// Sets all input delays to the one of least cost on a grid (numerators solved for every
/// candidate).
void search_delay(const FitProblem& problem, FitParameters& beta);

}  // namespace stageid
