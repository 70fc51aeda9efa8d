// Approximations of low rank with weights: the minimum for separable weights, bounds and stationarity for others.

#include "estimation/equations/weighted_low_rank.hpp"

#include <gtest/gtest.h>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_weighted_low_rank {

constexpr Eigen::Index kRows = 9;
constexpr Eigen::Index kColumns = 6;

Eigen::MatrixXd positive(test::RandomNumbers& random, Eigen::Index rows, Eigen::Index columns) {
  return test::random_matrix(random, rows, columns).array().exp();
}

double distance(const Eigen::MatrixXcd& L, const Eigen::MatrixXd& weight,
                const WeightedLowRank::Factors& f) {
  return (L - f.phi * f.psi.transpose()).cwiseAbs2().cwiseProduct(weight).sum();
}

TEST(WeightedLowRank, WithSeparableWeightsIsTheTruncatedSvdOfTheScaledMatrix) {
  test::RandomNumbers random(1);
  const Eigen::VectorXd rows = positive(random, kRows, 1);
  const Eigen::VectorXd columns = positive(random, kColumns, 1);
  const Eigen::MatrixXcd L = test::circular_matrix(random, kRows, kColumns);
  const Eigen::MatrixXd weight = rows.cwiseAbs2() * columns.cwiseAbs2().transpose();
  const Eigen::VectorXd s =
      svd(Eigen::MatrixXcd(rows.asDiagonal() * L * columns.asDiagonal()), 0).singularValues();
  const WeightedLowRank low_rank(L, weight);
  for (Eigen::Index rank = 1; rank < kColumns; ++rank) {
    const double expected = s.tail(kColumns - rank).squaredNorm();
    EXPECT_NEAR(low_rank.least_distance(rank), expected, 1e-12 * expected) << rank;
    EXPECT_NEAR(distance(L, weight, low_rank.factors(rank)), expected, 1e-9 * expected) << rank;
  }
  EXPECT_EQ(low_rank.least_distance(kColumns), 0.0);
}

TEST(WeightedLowRank, WithOtherWeightsNoChangeOfTheFactorsIsBetterAndNoneBelowTheBound) {
  test::RandomNumbers random(2);
  const Eigen::MatrixXcd L = test::circular_matrix(random, kRows, kColumns);
  const Eigen::MatrixXd weight = positive(random, kRows, kColumns);
  const WeightedLowRank low_rank(L, weight);
  for (const Eigen::Index rank : {1, 2, 4}) {
    const WeightedLowRank::Factors f = low_rank.factors(rank);
    const double best = distance(L, weight, f);
    EXPECT_NEAR(f.distance, best, 1e-12 * best) << rank;
    EXPECT_LE(low_rank.least_distance(rank), best) << rank;
    for (int trial = 0; trial < 20; ++trial) {
      WeightedLowRank::Factors other = f;
      other.phi += 1e-2 * test::circular_matrix(random, kRows, rank);
      other.psi += 1e-2 * test::circular_matrix(random, kColumns, rank);
      EXPECT_GT(distance(L, weight, other), best) << rank;
    }
  }
}

TEST(WeightedLowRank, RecoversAMatrixOfItsRankAlsoBesideEntriesWithoutWeight) {
  test::RandomNumbers random(3);
  const Eigen::MatrixXcd left = test::circular_matrix(random, kRows, 2);
  const Eigen::MatrixXcd exact = left * test::circular_matrix(random, 2, kColumns);
  Eigen::MatrixXcd L = exact;
  Eigen::MatrixXd weight = positive(random, kRows, kColumns);
  weight(3, 4) = 0.0;
  L(3, 4) += 100.0;
  const WeightedLowRank::Factors f = WeightedLowRank(L, weight).factors(2);
  EXPECT_LT((exact - f.phi * f.psi.transpose()).cwiseAbs().maxCoeff(), 1e-6);
}

}  // namespace stageid::test_weighted_low_rank
