// The design of a permanent excitation against optima that are known in closed form, and its forecast against a tracker.
#include "estimation/tracking/watch_design.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {
namespace test_watch_design {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

MatrixXd total_power(Index lines) { return MatrixXd::Ones(1, lines); }
MatrixXd weak_prior(Index q) { return 1e-9 * MatrixXd::Identity(q, q); }

/// Equivalence theorem: at the optimum no line offers more than the mean of all.
void expect_optimal(const std::vector<MatrixXd>& information, const InformativePower& design) {
  for (const MatrixXd& M : information)
    EXPECT_LE((design.gradient_root.transpose() * M * design.gradient_root).trace(), 1.0 + 1e-2);
  EXPECT_LE(design.gap, 1e-2);
  EXPECT_GE(design.gap, -1e-9);
}

TEST(InformativePower, GivesEveryModeThePowerThatMakesThemEqual) {
  const VectorXd a = (VectorXd(3) << 1.0, 4.0, 10.0).finished();
  const VectorXd scale = (VectorXd(3) << 1.0, 0.5, 1.0).finished();
  std::vector<MatrixXd> information;
  for (Index k = 0; k < 3; ++k)
    information.emplace_back(a[k] * VectorXd::Unit(3, k) * VectorXd::Unit(3, k).transpose());
  const InformativePower design =
      most_informative_power(information, weak_prior(3), scale, total_power(3));
  const VectorXd wanted = (a.array() * scale.array().square()).inverse();
  EXPECT_TRUE(design.power.isApprox(wanted / wanted.sum(), 1e-3)) << design.power;
  EXPECT_NEAR(design.variance.maxCoeff(), wanted.sum(), 1e-3 * wanted.sum());
  expect_optimal(information, design);
}

TEST(InformativePower, MeasuresASlopeAtBothEnds) {
  std::vector<MatrixXd> information;
  for (int k = -10; k <= 10; ++k) {
    const Eigen::Vector2d row(1.0, 0.1 * k);
    information.emplace_back(row * row.transpose());
  }
  const InformativePower design = most_informative_power(
      information, weak_prior(2), Eigen::Vector2d(0.0, 1.0), total_power(21), 1000);
  EXPECT_NEAR(design.power[0], 0.5, 1e-2);
  EXPECT_NEAR(design.power[20], 0.5, 1e-2);
  EXPECT_EQ(design.variance[0], 0.0);
  EXPECT_NEAR(design.variance[1], 1.0, 1e-2);
  expect_optimal(information, design);
}

TEST(InformativePower, KeepsSeveralLimitsOfWhichOneIsActive) {
  const std::vector<MatrixXd> information(2, MatrixXd::Ones(1, 1));
  const MatrixXd bounds = (MatrixXd(2, 2) << 1.0, 4.0, 0.1, 0.1).finished();
  const InformativePower design =
      most_informative_power(information, weak_prior(1), VectorXd::Ones(1), bounds);
  EXPECT_NEAR((bounds * design.power).maxCoeff(), 1.0, 1e-12);
  EXPECT_NEAR(design.power[0], 1.0, 1e-2);  // the line that moves less
  EXPECT_LE(design.gap, 1e-2);
  EXPECT_THROW(most_informative_power({MatrixXd::Ones(1, 1)}, weak_prior(1), VectorXd::Zero(1),
                                      total_power(1)),
               std::invalid_argument);
}

TEST(InformativePhases, AddUpWhatTheAxesMove) {
  RandomNumbers random(1);
  LineSensitivity line;
  VectorXcd r(4);
  double sum = 0.0;
  for (Index j = 0; j < 4; ++j) {
    line.emplace_back(MatrixXcd::Constant(1, 1, random.circular()));
    sum += std::abs(line.back()(0, 0));
    r[j] = std::polar(1.0, random.uniform(0.0, 6.0));
  }
  r = most_informative_phases(line, MatrixXd::Ones(1, 1), r);
  EXPECT_TRUE(r.cwiseAbs().isOnes(1e-12));
  EXPECT_NEAR(information(sensitivity(line, r))(0, 0), 2.0 * sum * sum, 1e-6 * sum * sum);
}

/// One mode between two actuators and two sensors.
AdditiveModel one_mode() {
  AdditiveModel model;
  model.inputs.names = {"a1", "a2"};
  model.outputs.names = {"y1", "y2"};
  model.sample_rate_hz = 1000.0;
  model.hold = HoldModel::exact;
  const double omega = 2.0 * std::numbers::pi * 100.0;
  Submodel mode;
  mode.denominator = {1.0, 2.0 * 0.02 / omega, 1.0 / (omega * omega)};
  mode.numerator = {(MatrixXd(2, 2) << 1.0, 0.5, -0.4, 0.7).finished()};
  model.submodels = {mode};
  return model;
}

TEST(WatchForecast, DeviationIsThatOfTheTracker) {
  const AdditiveModel model = one_mode();
  const VectorXd frequency_hz = VectorXd::LinSpaced(30, 85.0, 115.0);
  const TrackedResponse response(
      model, tracked_parameters(model, {frequency_hz[0], frequency_hz[29]}), frequency_hz);
  const MatrixXcd noise_root =
      1e-2 * (MatrixXcd(2, 2) << 1.0, 0.0, std::complex<double>(0.3, 0.4), 0.8).finished();
  RandomNumbers random(2);
  const MatrixXcd U = test::circular_matrix(random, 2, 30);
  TrackerOptions options;
  options.learning_periods = 256;
  std::vector<MatrixXcd> one_period;
  std::vector<MatrixXcd> U_of_line;
  for (Index k = 0; k < 30; ++k) U_of_line.emplace_back(U.col(k));
  const std::vector<MatrixXcd> noise(30, noise_root * noise_root.adjoint());
  const std::vector<LineSensitivity> lines = line_sensitivities(response, U_of_line, noise);
  for (const LineSensitivity& line : lines)
    one_period.push_back(sensitivity(line, VectorXcd::Ones(1)));
  const MatrixXd prior = prior_information(response.parameters(), model.sample_rate_hz);
  const WatchForecast forecast = watch_forecast(one_period, line_motions(response, noise), prior,
                                                VectorXd::Constant(response.size(), 1e-3), options);

  ModelTracker tracker(model, frequency_hz, options);
  const MatrixXcd Y = TrackedResponse::outputs(response.at(VectorXd::Zero(response.size())), U);
  for (int period = 0; period < options.learning_periods; ++period)
    tracker.add({Y + noise_root * test::circular_matrix(random, 2, 30), U});
  const VectorXd tracked = (options.learning_periods * tracker.covariance().diagonal()).cwiseSqrt();
  // 256 periods estimate a deviation to 4 %.
  for (Index p = 0; p < tracked.size(); ++p)
    EXPECT_NEAR(tracked[p], forecast.deviation[p], 0.1 * forecast.deviation[p])
        << to_string(response.parameters()[p].kind);
  EXPECT_GE(forecast.periods.minCoeff(), 3.0);
}

TEST(WatchForecast, ASmallerChangeIsDetectedLater) {
  const std::vector<MatrixXcd> J(4, std::sqrt(0.5e10) * MatrixXcd::Identity(2, 1));
  const std::vector<MatrixXcd> of_the_other(4, MatrixXcd::Identity(2, 2).col(1));
  const auto periods = [&](double change) {
    return watch_forecast(J, of_the_other, weak_prior(1), VectorXd::Constant(1, change), {})
        .periods[0];
  };
  EXPECT_EQ(periods(1e-3), 3.0);
  EXPECT_LT(periods(1e-5), periods(0.6e-5));
  EXPECT_TRUE(std::isinf(periods(1e-8)));
}

TEST(WatchForecast, AChangeThatLooksLikeAFreeMotionIsNotDetected) {
  const std::vector<MatrixXcd> J(4, MatrixXcd::Constant(2, 1, 5e4));
  const WatchForecast forecast =
      watch_forecast(J, J, weak_prior(1), VectorXd::Constant(1, 1e-3), {});
  EXPECT_TRUE(std::isinf(forecast.periods[0]));
}

}  // namespace test_watch_design
}  // namespace stageid::test
