#include "excitation/plan/least_variance_power.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "excitation/multisine/random_stream.hpp"
#include "tests/acquisition/files/expect_error.hpp"

namespace stageid::test_least_variance_power {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd random_positive(Eigen::Index size, std::uint64_t seed) {
  UniformStream random(seed);
  VectorXd values(size);
  for (double& value : values) value = std::exp(8.0 * random.next() - 4.0);
  return values;
}

// Lagrange: a_i = sqrt(c_i / b_i) / sum sqrt(c b), cost (sum sqrt(c b))^2.
TEST(LeastVariancePower, OneBoundHasTheKnownOptimum) {
  const VectorXd c = random_positive(50, 1);
  const VectorXd b = random_positive(50, 2);
  const PowerSpectrum found = least_variance_power(c, b.transpose());
  const double root_sum = (c.array() * b.array()).sqrt().sum();
  // The cost is flat near the optimum: a gap of 1e-6 corresponds to 1e-3 in a.
  EXPECT_LT(
      ((found.power.array() * root_sum) / (c.array() / b.array()).sqrt() - 1.0).abs().maxCoeff(),
      2e-3);
  EXPECT_NEAR(found.cost, root_sum * root_sum, 1e-6 * root_sum * root_sum);
  EXPECT_NEAR(b.dot(found.power), 1.0, 1e-12);
}

TEST(LeastVariancePower, BoundsThatShareNothingAreProblemsOfTheirOwn) {
  MatrixXd bounds = MatrixXd::Zero(2, 4);
  bounds << 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 5.0, 1.0;
  const VectorXd c = random_positive(4, 3);
  const PowerSpectrum found = least_variance_power(c, bounds);
  const double first = std::pow(std::sqrt(c[0]) + std::sqrt(2.0 * c[1]), 2);
  const double second = std::pow(std::sqrt(5.0 * c[2]) + std::sqrt(c[3]), 2);
  EXPECT_NEAR(found.cost, first + second, 1e-6 * (first + second));
}

TEST(LeastVariancePower, CostAndLowerBoundMeet) {
  for (std::uint64_t seed = 10; seed < 20; ++seed) {
    const VectorXd c = random_positive(300, seed);
    MatrixXd bounds(12, 300);
    for (Eigen::Index i = 0; i < bounds.rows(); ++i)
      bounds.row(i) = random_positive(300, 100 * seed + static_cast<std::uint64_t>(i)).transpose();
    const PowerSpectrum found = least_variance_power(c, bounds);
    EXPECT_LE((bounds * found.power).maxCoeff(), 1.0 + 1e-12);
    EXPECT_NEAR((c.array() / found.power.array()).sum(), found.cost, 1e-12 * found.cost);
    EXPECT_LE(found.lower_bound, found.cost * (1.0 + 1e-12));
    EXPECT_LE(found.cost, found.lower_bound * (1.0 + 1e-4));
  }
}

TEST(LeastVariancePower, ABoundThatCannotBeReachedDoesNotMatter) {
  const VectorXd c = random_positive(40, 4);
  MatrixXd bounds(2, 40);
  bounds.row(0) = random_positive(40, 5).transpose();
  bounds.row(1) = 0.01 * bounds.row(0);
  const double alone = least_variance_power(c, bounds.topRows(1)).cost;
  EXPECT_NEAR(least_variance_power(c, bounds).cost, alone, 1e-6 * alone);
}

TEST(LeastVariancePower, RefusesWhatHasNoAnswer) {
  const VectorXd c = VectorXd::Ones(3);
  const MatrixXd bounds = MatrixXd::Ones(1, 3);
  const auto refuse = [](const VectorXd& cost, const MatrixXd& b, const char* text) {
    test::expect_error<std::invalid_argument>([&] { least_variance_power(cost, b); },
                                              "excitation power: ", text);
  };
  refuse(VectorXd::Ones(2), bounds, "one column per cost");
  refuse(-c, bounds, "nonnegative");
  refuse(VectorXd::Zero(3), bounds, "at least one must be positive");
  refuse(c, -bounds, "bounds must be finite and nonnegative");
  MatrixXd open = bounds;
  open(0, 1) = 0.0;
  refuse(c, open, "entry 1 is unbounded");
}

}  // namespace stageid::test_least_variance_power
