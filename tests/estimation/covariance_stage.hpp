#pragma once

#include <cmath>

#include "estimation/problem/fit_options.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test {

/// A 2 x 3 stage behind a hold: rigid body and three modes, the last two 1.3 half-power widths
/// apart. G is exact, and W is the inverse of the noise variance: a floor and a part of |G|.
inline DenseProblem covariance_stage() {
  RandomNumbers random(9);
  DenseProblem problem =
      stage_2x3(HoldModel::exact, random, {{310.0, 0.02}, {900.0, 0.015}, {936.0, 0.015}});
  problem.model.hold = HoldModel::exact;
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(180, 40.0, 1500.0);
  measure(problem);
  const double floor = 1e-3 * problem.G.cwiseAbs().mean();
  problem.W = (problem.G.cwiseAbs2() * 1e-4).array() + floor * floor;
  problem.W = problem.W.cwiseInverse().eval();
  return problem;
}

inline Eigen::MatrixXcd noisy(RandomNumbers& random, const DenseProblem& problem,
                              const Eigen::MatrixXd& variance) {
  Eigen::MatrixXcd G = problem.G;
  for (Eigen::Index k = 0; k < G.cols(); ++k)
    for (Eigen::Index c = 0; c < G.rows(); ++c)
      G(c, k) += std::sqrt(variance(c, k)) * random.circular();
  return G;
}

/// A measurement of it with noise of such a variance, which the FRF knows.
inline FrfEstimate noisy_frf(RandomNumbers& random, const DenseProblem& problem,
                             const Eigen::MatrixXd& variance) {
  FrfEstimate frf = frf_of(problem);
  frf.response = noisy(random, problem, variance);
  frf.noise_variance = variance;
  return frf;
}

}  // namespace stageid::test
