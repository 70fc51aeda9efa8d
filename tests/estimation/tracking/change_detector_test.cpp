#include "estimation/tracking/change_detector.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_change_detector {

constexpr int kReference = 32;

/// Scores of a stage: correlated, divided by an estimated deviation, minus the mean of a reference.
class Scores {
 public:
  Scores(const Eigen::MatrixXd& correlation, double freedom, std::uint64_t seed)
      : factor_(test::cholesky(correlation.cast<std::complex<double>>()).real()),
        freedom_(freedom),
        random_(seed) {
    learn();
  }
  /// Another reference.
  void learn() {
    error_ = draw() / std::sqrt(kReference);
    scale_.resize(factor_.rows());
    for (double& scale : scale_) scale = 1.0 / std::sqrt(random_.chi_square_mean(0.5 * freedom_));
  }
  Eigen::VectorXd next() { return scale_.cwiseProduct(draw() - error_); }

 private:
  Eigen::VectorXd draw() { return factor_ * test::random_vector(random_, factor_.cols()); }

  Eigen::MatrixXd factor_;
  double freedom_;
  test::RandomNumbers random_;
  Eigen::VectorXd error_;
  Eigen::VectorXd scale_;
};

Eigen::MatrixXd correlation_of(Eigen::Index hypotheses, double neighbours) {
  Eigen::MatrixXd out(hypotheses, hypotheses);
  for (Eigen::Index i = 0; i < hypotheses; ++i)
    for (Eigen::Index j = 0; j < hypotheses; ++j)
      out(i, j) = std::pow(neighbours, static_cast<double>(std::abs(i - j)));
  return out;
}

TEST(ChangeDetector, HasTheStatisticOfAHandMadeCase) {
  constexpr double kFreedom = 10.0;
  ChangeDetector detector(Eigen::MatrixXd::Identity(2, 2), Eigen::Vector2d(kFreedom, 1e9), 1e-6, 4);
  const auto of = [](double sum, double w, double nu) {
    return nu * std::log1p(sum * sum / (w * (1.0 + w / 4.0)) / nu);
  };
  EXPECT_EQ(detector.add(Eigen::Vector2d(1.0, 0.5)), 0);
  EXPECT_NEAR(detector.largest(), of(1.0, 1.0, kFreedom), 1e-12);
  EXPECT_EQ(detector.add(Eigen::Vector2d(1.5, -0.5)), 0);
  EXPECT_NEAR(detector.largest(), of(2.5, 2.0, kFreedom), 1e-12);
  // Windows of three periods are only used to date a change: two and one compete here.
  EXPECT_EQ(detector.add(Eigen::Vector2d(0.0, -1.8)), 0);
  EXPECT_NEAR(detector.largest(), of(1.8, 1.0, 1e9), 1e-9);
  EXPECT_NEAR(detector.largest_by_hypothesis()[0], of(1.5, 2.0, kFreedom), 1e-12);
  EXPECT_NEAR(detector.largest_by_hypothesis()[1], detector.largest(), 1e-15);
  EXPECT_NEAR(detector.mean_scores(3)[0], 2.5 / 3.0, 1e-15);
  EXPECT_NEAR(detector.mean_scores(2)[1], -2.3 / 2.0, 1e-15);
  detector.restart();
  EXPECT_EQ(detector.add(Eigen::Vector2d(0.1, 0.2)), 0);
  EXPECT_NEAR(detector.largest(), of(0.2, 1.0, 1e9), 1e-9);
}

/// Alarms of many stages, each watched until its first alarm.
void expect_rate(Eigen::Index hypotheses, double neighbours, double freedom, double rate,
                 int periods) {
  const Eigen::MatrixXd correlation = correlation_of(hypotheses, neighbours);
  Scores scores(correlation, freedom, 7);
  ChangeDetector detector(correlation, Eigen::VectorXd::Constant(hypotheses, freedom), rate,
                          kReference);
  int alarms = 0;
  int life = 0;
  for (int t = 0; t < periods; ++t) {
    ++life;
    const bool alarm = detector.add(scores.next()) > 0;
    if (alarm) ++alarms;
    if (!alarm && life < 2000) continue;
    detector.restart();
    scores.learn();
    life = 0;
  }
  // The threshold is known within 15 % of the rate (one deviation), the alarms within their square root.
  const double expected = rate * periods;
  EXPECT_NEAR(alarms, expected, 2.0 * std::hypot(0.15 * expected, std::sqrt(expected)));
}

TEST(ChangeDetector, HasTheStatedRateOfFalseAlarms) {
  for (const double neighbours : {0.0, 0.9}) {  // independent and correlated scores
    expect_rate(8, neighbours, 200.0, 1e-2, 30000);
    expect_rate(8, neighbours, 200.0, 1e-3, 200000);
  }
  expect_rate(8, 0.5, 31.0, 1e-3, 200000);
  expect_rate(8, 0.5, 31.0, 1e-4, 300000);
}

TEST(ChangeDetector, ACorrelatedScoreCostsLessThreshold) {
  const auto threshold = [](double neighbours) {
    return ChangeDetector(correlation_of(8, neighbours), Eigen::VectorXd::Constant(8, 200.0), 1e-3,
                          kReference)
        .threshold();
  };
  EXPECT_LT(threshold(0.98), threshold(0.0) - 1.0);
}

TEST(ChangeDetector, DatesAShift) {
  const Eigen::MatrixXd correlation = correlation_of(5, 0.3);
  Scores scores(correlation, 200.0, 8);
  ChangeDetector detector(correlation, Eigen::VectorXd::Constant(5, 200.0), 1e-4, kReference);
  int found = 0;
  int near_truth = 0;
  for (int run = 0; run < 50; ++run) {
    detector.restart();
    scores.learn();
    const int before = 40 + 3 * run;
    for (int t = 0; t < before; ++t) detector.add(scores.next());
    for (int since = 1; since <= 60; ++since) {
      const int periods = detector.add(scores.next() + 2.0 * Eigen::VectorXd::Unit(5, 3));
      if (periods == 0) continue;
      ++found;
      if (std::abs(periods - since) <= 2) ++near_truth;
      Eigen::Index largest = 0;
      detector.mean_scores(periods).maxCoeff(&largest);
      EXPECT_EQ(largest, 3);
      break;
    }
  }
  EXPECT_EQ(found, 50);
  EXPECT_GE(near_truth, 40);
}

TEST(ChangeDetector, ALongWatchKeepsItsWindows) {
  ChangeDetector detector(Eigen::MatrixXd::Identity(1, 1), Eigen::VectorXd::Constant(1, 1e9), 1e-6,
                          1000000);
  // Beyond the ring of 513 sums: alternating scores cancel in every window but the shortest.
  for (int t = 0; t < 2000; ++t)
    EXPECT_EQ(detector.add(Eigen::VectorXd::Constant(1, t % 2 == 0 ? 1.0 : -1.0)), 0);
  EXPECT_NEAR(detector.largest(), 1.0, 1e-5);
  EXPECT_NEAR(detector.mean_scores(512)[0], 0.0, 1e-12);
  EXPECT_NEAR(detector.mean_scores(511)[0], -1.0 / 511.0, 1e-12);
}

TEST(ChangeDetector, RefusesScoresWithoutVariance) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(1, 1);
  EXPECT_THROW(ChangeDetector(one, Eigen::VectorXd::Constant(1, nan), 1e-6, 32),
               std::invalid_argument);
  EXPECT_THROW(ChangeDetector(nan * one, Eigen::VectorXd::Constant(1, 30.0), 1e-6, 32),
               std::invalid_argument);
}

}  // namespace stageid::test_change_detector
