// The rank of a residue that its standard deviations require, also where there are many outputs and inputs.

#include "estimation/fit/residue_ranks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_residue_ranks {

/// A mode whose residue has a rank, with noise of a standard deviation that varies from entry to entry.
AdditiveModel mode_of_rank(int rank, Eigen::Index outputs, Eigen::Index inputs) {
  test::RandomNumbers random(static_cast<unsigned>(rank));
  const double omega = 2.0 * std::numbers::pi * 100.0;
  Submodel mode;
  mode.denominator = {1.0, 0.02 / omega, 1.0 / (omega * omega)};
  const Eigen::MatrixXd left = test::random_matrix(random, outputs, rank);
  const Eigen::MatrixXd exact = left * test::random_matrix(random, rank, inputs);
  mode.numerator_std = {0.01 * test::random_matrix(random, outputs, inputs).array().exp()};
  mode.numerator = {
      exact + mode.numerator_std[0].cwiseProduct(test::random_matrix(random, outputs, inputs))};
  mode.natural_frequency_std_hz = 0.01;
  AdditiveModel model;
  model.submodels = {mode};
  model.fit.band_hz[0] = 10.0;
  model.fit.band_hz[1] = 1000.0;
  return model;
}

int rank_found(const AdditiveModel& model) {
  const auto tests = residue_rank_tests(model, 1e5);
  EXPECT_EQ(tests.size(), 1U);
  return tests.at(0).rank;
}

TEST(ResidueRankTests, FindEveryRank) {
  for (const int rank : {1, 2, 5, 11}) EXPECT_EQ(rank_found(mode_of_rank(rank, 20, 12)), rank);
}

TEST(ResidueRankTests, OfFullRankAmongManyInputsEndSoon) {
  EXPECT_EQ(rank_found(mode_of_rank(60, 120, 60)), 60);
}

}  // namespace stageid::test_residue_ranks
