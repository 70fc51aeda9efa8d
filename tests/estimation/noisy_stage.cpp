#include "tests/estimation/noisy_stage.hpp"

#include <gtest/gtest.h>

namespace stageid::test {

DenseProblem stage_2x3(HoldModel hold, RandomNumbers& random,
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
    problem.model.submodels.push_back(empty_mode(problem.model, frequency_hz, damping_ratio));
  for (Submodel& s : problem.model.submodels)
    for (double& value : s.numerator[0].reshaped())
      value = (s.is_mode() ? s.denominator[2] : 1.0) * random.normal();
  return problem;
}

DenseProblem noisy_stage(HoldModel hold, double noise, std::uint64_t seed) {
  RandomNumbers random(seed);
  DenseProblem problem = stage_2x3(hold, random, {{260.0, 0.02}, {900.0, 0.012}, {914.0, 0.010}});
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(400, 20.0, 1800.0);
  measure(problem);
  add_relative_noise(problem.G, noise, random);
  problem.W = problem.G.cwiseAbs2().cwiseInverse();
  return problem;
}

FitOptions options_with(Weighting weighting) {
  return fit_options(weighting, HoldModel::exact, DelayModel::estimate, 1.37e-4);
}

AdditiveModel moved(const AdditiveModel& model, double frequency_factor, double damping_factor) {
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

Eigen::ArrayXd scatter_of(const Eigen::MatrixXd& values) {
  const Eigen::VectorXd mean = values.rowwise().mean();
  return (values.colwise() - mean).rowwise().squaredNorm() / static_cast<double>(values.cols() - 1);
}

void expect_honest(const Eigen::ArrayXd& scatter, const Eigen::ArrayXd& reported) {
  const Eigen::ArrayXd ratio = scatter / reported;
  EXPECT_GT(ratio.minCoeff(), kLowestRatio) << ratio.transpose();
  EXPECT_LT(ratio.maxCoeff(), kHighestRatio) << ratio.transpose();
}

}  // namespace stageid::test
