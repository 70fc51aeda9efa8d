#include "frf/runs/value_grid.hpp"

#include <gtest/gtest.h>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_value_grid {

Eigen::VectorXd gaussian(int count, std::uint64_t seed) {
  test::RandomNumbers random(seed);
  return test::random_vector(random, count);
}

double step_of(const Eigen::VectorXd& samples) {
  ValueGrid grid;
  grid.add(samples);
  return grid.step();
}

TEST(ValueGrid, FindsTheStepAlsoBesideZeroAndNoneWithoutAConverter) {
  const Eigen::VectorXd counts = (gaussian(500, 1) * 300.0).array().round();
  for (const double step : {1e-8, 0.1, 0.3, 7.0}) {
    SCOPED_TRACE(step);
    EXPECT_NEAR(step_of(step * counts), step, 1e-6 * step);
    EXPECT_NEAR(step_of((step * counts).array() + 0.37 * step), step, 1e-6 * step);
  }
  EXPECT_EQ(step_of(gaussian(500, 2)), 0.0);
  EXPECT_EQ(step_of(Eigen::VectorXd::Constant(500, 3.0)), 0.0);
  EXPECT_EQ(step_of(Eigen::VectorXd()), 0.0);
}

TEST(ValueGrid, OfPartsIsThatOfTheWhole) {
  const Eigen::VectorXd even = 0.2 * (gaussian(50, 3) * 100.0).array().round();
  ValueGrid whole;
  for (const Eigen::VectorXd& samples : {even, Eigen::VectorXd(even.array() + 0.1)}) {
    ValueGrid part;
    part.add(samples);
    EXPECT_NEAR(part.step(), 0.2, 1e-9);
    whole.add(part);
  }
  EXPECT_NEAR(whole.step(), 0.1, 1e-9);
  ValueGrid continuous;
  continuous.add(gaussian(50, 4));
  whole.add(continuous);
  EXPECT_EQ(whole.step(), 0.0);
}

}  // namespace stageid::test_value_grid
