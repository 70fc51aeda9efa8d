#pragma once

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/models/model_reference.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test {

/// A 2 x 3 stage behind `hold` and, if there is one, 0.137 ms: rigid body, modes {Hz, damping ratio},
/// random numerators. No response yet.
inline DenseProblem stage_2x3(HoldModel hold, RandomNumbers& random,
                              const std::vector<std::pair<double, double>>& modes) {
  DenseProblem problem;
  problem.model = named_model(2, 3);
  problem.hold = hold;
  if (hold != HoldModel::none) {
    problem.model.sample_rate_hz = 1e4;
    problem.model.input_delay_s.setConstant(1.37e-4);
  }
  problem.model.submodels = {empty_submodel(problem.model, 2, {}, 1)};
  for (const auto& [frequency_hz, damping_ratio] : modes)
    problem.model.submodels.push_back(
        empty_submodel(problem.model, 0, mode_coefficients(frequency_hz, damping_ratio), 1));
  for (Submodel& s : problem.model.submodels)
    for (double& value : s.numerator[0].reshaped())
      value = (s.is_mode() ? s.denominator[2] : 1.0) * random.normal();
  return problem;
}

/// One with two modes 1.5 % apart, and relative noise.
inline DenseProblem noisy_stage(HoldModel hold, double noise, std::uint64_t seed = 1) {
  RandomNumbers random(seed);
  DenseProblem problem = stage_2x3(hold, random, {{260.0, 0.02}, {900.0, 0.012}, {914.0, 0.010}});
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(400, 20.0, 1800.0);
  problem.G = reference_response(problem.model, problem.frequency_hz, problem.hold);
  for (std::complex<double>& value : problem.G.reshaped()) value *= 1.0 + noise * random.circular();
  problem.W = problem.G.cwiseAbs2().cwiseInverse();
  return problem;
}

/// The model as a start: poles moved by these factors, numerators zero.
inline AdditiveModel moved(const AdditiveModel& model, double frequency_factor,
                           double damping_factor) {
  AdditiveModel start;
  for (Submodel s : model.submodels) {
    for (Eigen::MatrixXd& B : s.numerator) B.setZero();
    if (s.is_mode()) {
      const std::vector<double> a = mode_coefficients(s.natural_frequency_hz() * frequency_factor,
                                                      s.damping_ratio() * damping_factor);
      s.denominator = {1.0, a[0], a[1]};
    }
    start.submodels.push_back(s);
  }
  return start;
}

/// Repetitions of a measurement, and the bounds of a sample variance over the true one: chi^2 of 149 degrees of freedom
/// over its mean lies in here with 99.99 %, 1 +- 3.9 sqrt(2 / 149) with its skewness (Wilson and Hilferty).
inline constexpr int kRuns = 150;
inline constexpr double kLowestRatio = 0.62;
inline constexpr double kHighestRatio = 1.52;

/// The sample variances of quantities x runs.
inline Eigen::ArrayXd scatter_of(const Eigen::MatrixXd& values) {
  const Eigen::VectorXd mean = values.rowwise().mean();
  return (values.colwise() - mean).rowwise().squaredNorm() / static_cast<double>(values.cols() - 1);
}

inline void expect_honest(const Eigen::ArrayXd& scatter, const Eigen::ArrayXd& reported) {
  const Eigen::ArrayXd ratio = scatter / reported;
  EXPECT_GT(ratio.minCoeff(), kLowestRatio) << ratio.transpose();
  EXPECT_LT(ratio.maxCoeff(), kHighestRatio) << ratio.transpose();
}

}  // namespace stageid::test
