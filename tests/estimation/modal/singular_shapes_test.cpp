#include "estimation/modal/singular_shapes.hpp"

#include <gtest/gtest.h>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_singular_shapes {

template <typename Matrix>
void expect_sum(const Matrix& M) {
  const auto shapes = singular_shapes(M);
  const Matrix scaled = shapes.output * shapes.singular_value.asDiagonal();
  const Matrix sum = scaled * shapes.input.transpose();
  EXPECT_LT((sum - M).norm(), 1e-14 * M.norm());
  EXPECT_NEAR(shapes.output.col(0).norm(), 1.0, 1e-14);
  EXPECT_NEAR(shapes.input.col(0).norm(), 1.0, 1e-14);
}

TEST(SingularShapes, SumUpToTheMatrix) {
  test::RandomNumbers random(3);
  for (const auto& [rows, cols] : {std::pair{4, 13}, {5, 2}, {1, 3}, {3, 1}}) {
    const Eigen::MatrixXcd M = test::circular_matrix(random, rows, cols);
    expect_sum(M);
    expect_sum(Eigen::MatrixXd(M.real()));
  }
}

TEST(SingularShapes, TheLeadingComponentIsPositiveWhateverRoundingSays) {
  // Components of equal magnitude: a tiny change makes another one the largest, and nothing turns.
  const Eigen::VectorXd input{{1.0, 2.0}};
  for (const double change : {-1e-9, 0.0, 1e-9}) {
    const Eigen::VectorXd output{{0.5, -1.0, 1.0 + change}};
    const auto shapes = singular_shapes(Eigen::MatrixXd(output * input.transpose()));
    EXPECT_NEAR(shapes.output(1, 0), 2.0 / 3.0, 1e-8);
    EXPECT_NEAR(shapes.output(2, 0), -2.0 / 3.0, 1e-8);
    EXPECT_LT(shapes.input(0, 0), 0.0);
  }
}

TEST(SingularShapes, AComplexShapeIsTurnedToo) {
  const std::complex<double> turn = std::polar(1.0, 1.1);
  const Eigen::VectorXcd output = turn * Eigen::VectorXcd{{0.2, std::complex<double>(0.0, 1.0)}};
  const Eigen::VectorXcd input{{1.0, 0.0}};
  const auto shapes = singular_shapes(Eigen::MatrixXcd(output * input.transpose()));
  EXPECT_NEAR(shapes.output(1, 0).imag(), 0.0, 1e-15);
  EXPECT_GT(shapes.output(1, 0).real(), 0.9);
}

TEST(NumericalRank, CountsWhatIsAboveTheTolerance) {
  const Eigen::VectorXd values{{1.0, 1e-9, 1e-11}};
  EXPECT_EQ(numerical_rank(values, 1.0), 2);
  EXPECT_EQ(numerical_rank(values, 100.0), 1);
  EXPECT_EQ(numerical_rank(Eigen::VectorXd::Zero(2), 0.0), 0);
}

}  // namespace stageid::test_singular_shapes
