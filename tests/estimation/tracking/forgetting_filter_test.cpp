#include "estimation/tracking/forgetting_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_forgetting_filter {

constexpr Eigen::Index kSize = 3;
constexpr double kForgetting = 0.9;

struct Period {
  Eigen::MatrixXd J;
  Eigen::VectorXd z;
  Eigen::MatrixXd information() const { return J.transpose() * J; }
};

Period random_period(test::RandomNumbers& random, Eigen::Index rows) {
  return {test::random_matrix(random, rows, kSize), test::random_vector(random, rows)};
}

Eigen::MatrixXd prior() { return Eigen::Vector3d(0.3, 2.0, 40.0).asDiagonal(); }

void add(ForgettingFilter& filter, const Period& period) {
  filter.add(period.information(), period.information(),
             period.J.transpose() * (period.z - period.J * filter.estimate()));
}

TEST(ForgettingFilter, IsTheMinimizerOverAllPeriods) {
  test::RandomNumbers random(1);
  ForgettingFilter filter(prior(), kForgetting);
  std::vector<Period> periods;
  for (int n = 0; n < 40; ++n) {
    // One row only: the first periods do not determine all parameters.
    periods.push_back(random_period(random, 1));
    add(filter, periods.back());
    Eigen::MatrixXd normal = prior();
    Eigen::VectorXd right = Eigen::VectorXd::Zero(kSize);
    for (std::size_t age = 0; age < periods.size(); ++age) {
      const Period& period = periods[periods.size() - 1 - age];
      const double weight = std::pow(kForgetting, static_cast<double>(age));
      normal += weight * period.information();
      right += weight * period.J.transpose() * period.z;
    }
    // Rounding, times the condition of the prior.
    EXPECT_LT((filter.estimate() - least_squares(qr(normal), right)).norm(), 1e-12) << n;
  }
}

TEST(ForgettingFilter, SeveralPeriodsAtOnceHaveOneAge) {
  test::RandomNumbers random(2);
  ForgettingFilter filter(prior(), kForgetting);
  const Period first = random_period(random, 4);
  const Period next = random_period(random, 4);
  add(filter, first);
  constexpr int kPeriods = 5;
  const Eigen::MatrixXd A = next.information();
  filter.add(A, A, kPeriods * next.J.transpose() * (next.z - next.J * filter.estimate()), kPeriods);
  const double kept = std::pow(kForgetting, kPeriods);
  const Eigen::MatrixXd normal = prior() + kept * first.information() + kPeriods * A;
  const Eigen::VectorXd right =
      kept * first.J.transpose() * first.z + kPeriods * next.J.transpose() * next.z;
  EXPECT_LT((filter.estimate() - least_squares(qr(normal), right)).norm(), 1e-13);
}

TEST(ForgettingFilter, ForgetsEverythingButThePrior) {
  test::RandomNumbers random(3);
  ForgettingFilter filter(prior(), kForgetting);
  for (int n = 0; n < 5; ++n) add(filter, random_period(random, 4));
  filter.forget();
  EXPECT_EQ(filter.estimate(), Eigen::VectorXd::Zero(kSize));
  EXPECT_EQ(filter.information(), prior());
  EXPECT_LT((filter.covariance() - pseudo_inverse(prior())).norm(), 1e-14);
}

// The noise is larger than the weights assume, by a factor that differs between directions: only K knows it.
TEST(ForgettingFilter, HasTheCovarianceOfRepeatedEstimates) {
  test::RandomNumbers random(4);
  constexpr int kRuns = 4000;
  constexpr Eigen::Index kRows = 4;
  std::vector<Eigen::MatrixXd> J;
  for (int n = 0; n < 30; ++n) J.push_back(test::random_matrix(random, kRows, kSize));
  const Eigen::VectorXd noise{{1.0, 3.0, 0.5, 2.0}};
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(kSize, kSize);
  Eigen::MatrixXd stated;
  for (int run = 0; run < kRuns; ++run) {
    ForgettingFilter filter(prior(), kForgetting);
    const Eigen::VectorXd truth =
        prior().diagonal().cwiseSqrt().cwiseInverse().cwiseProduct(test::random_vector(random, 3));
    for (const Eigen::MatrixXd& now : J) {
      const Eigen::VectorXd e = noise.cwiseProduct(test::random_vector(random, kRows));
      filter.add(now.transpose() * now, now.transpose() * noise.cwiseAbs2().asDiagonal() * now,
                 now.transpose() * (now * (truth - filter.estimate()) + e));
    }
    const Eigen::VectorXd error = filter.estimate() - truth;
    scatter += error * error.transpose() / kRuns;
    stated = filter.covariance();
  }
  // The scatter, seen in units of the stated covariance, is the identity within 4 sqrt(2 / runs).
  const auto axes = symmetric_eigen(stated);
  const Eigen::MatrixXd white =
      axes.eigenvectors() * axes.eigenvalues().cwiseSqrt().cwiseInverse().asDiagonal();
  const Eigen::MatrixXd ratio = white.transpose() * scatter * white;
  EXPECT_LT((ratio - Eigen::MatrixXd::Identity(kSize, kSize)).cwiseAbs().maxCoeff(),
            4.0 * std::sqrt(2.0 / kRuns))
      << ratio;
}

}  // namespace stageid::test_forgetting_filter
