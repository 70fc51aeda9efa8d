#pragma once

#include <cmath>

#include "estimation/fit_options.hpp"
#include "tests/support/model_fit_problem.hpp"
#include "tests/support/model_reference.hpp"
#include "tests/support/random_stage.hpp"

namespace stageid::test {

/// A 2 x 3 stage behind a hold: rigid body and three modes, the last two 1.3 half-power widths
/// apart. G is exact, and W is the inverse of the noise variance: a floor and a part of |G|.
inline DenseProblem covariance_stage() {
  RandomNumbers random(9);
  DenseProblem problem;
  problem.model = named_model(2, 3);
  problem.hold = HoldModel::exact;
  problem.model.sample_rate_hz = 1e4;
  problem.model.hold = HoldModel::exact;
  problem.model.input_delay_s.setConstant(1.37e-4);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(180, 40.0, 1500.0);
  problem.model.submodels = {empty_submodel(problem.model, 2, {}, 1),
                             empty_submodel(problem.model, 0, mode_coefficients(310.0, 0.02), 1),
                             empty_submodel(problem.model, 0, mode_coefficients(900.0, 0.015), 1),
                             empty_submodel(problem.model, 0, mode_coefficients(936.0, 0.015), 1)};
  for (Submodel& s : problem.model.submodels)
    for (double& value : s.numerator[0].reshaped())
      value = (s.is_mode() ? s.denominator[2] : 1.0) * random.normal();
  problem.G = reference_response(problem.model, problem.frequency_hz, problem.hold);
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

/// Options for that stage.
inline FitOptions covariance_options(Weighting weighting) {
  FitOptions options;
  options.weighting = weighting;
  options.hold = HoldModel::exact;
  options.delay = DelayModel::estimate;
  options.delay_s = 1.37e-4;
  return options;
}

}  // namespace stageid::test
