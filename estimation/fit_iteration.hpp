#pragma once

#include <string>
#include <vector>

#include "estimation/fit_problem.hpp"

namespace stageid {

struct IterationResult {
  FitStatus status = FitStatus::iteration_limit;
  std::string message;
  std::vector<double> cost;  ///< the start (numerators solved) first
  int iterations = 0;
  Residual E;                        ///< at the returned parameters
  std::vector<Eigen::Index> frozen;  ///< globals that ended at a bound: no longer unknowns
};

/// Improves `beta` in place until the first-order condition holds: solve the numerators, step the
/// denominators and delays by the method's equations, re-solve, accept only what lowers the cost.
/// riv and gn: Levenberg-Marquardt damping; where the refined-IV step does not lower the cost, the
/// Gauss-Newton one is taken, which is a descent direction. sk: its own fixed point, undamped; the
/// iterate of least cost is returned.
IterationResult iterate(const FitProblem& problem, FitParameters& beta, const FitOptions& options);

/// `beta` with denominators and delays moved by `step` (globals long).
FitParameters stepped_globals(const FitProblem& problem, const FitParameters& beta,
                              const Eigen::VectorXd& step);

/// Sets all input delays to the one of least cost on a grid (numerators solved for every
/// candidate).
void search_delay(const FitProblem& problem, FitParameters& beta);

}  // namespace stageid
