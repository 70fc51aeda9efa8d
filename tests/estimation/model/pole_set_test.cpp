// Real partial fractions and the zeros of their sums, against products of factors written out.

#include "estimation/model/pole_set.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace stageid::test_pole_set {

using Complex = std::complex<double>;

const PoleSet kPoles{{{-0.1, 2.0}, {-0.3, 5.0}}, {-4.0}};

Eigen::VectorXcd some_x() {
  Eigen::VectorXcd x(3);
  x << Complex(0.0, 1.0), Complex(0.0, 2.1), Complex(0.5, 7.0);
  return x;
}

TEST(PoleSet, FractionsAreRealOnConjugatePairs) {
  const SplitMatrix phi = partial_fractions(kPoles, some_x());
  ASSERT_EQ(phi.cols(), 5);
  for (Eigen::Index k = 0; k < 3; ++k) {
    const Complex x = some_x()[k];
    for (Eigen::Index i = 0; i < 2; ++i) {
      const Complex p = kPoles.pairs[i];
      // Over their common denominator: (2 x - 2 Re p) and -2 Im p, both real in x.
      const Complex denominator = x * x - 2.0 * p.real() * x + std::norm(p);
      EXPECT_LT(std::abs(phi(k, 2 * i) - (2.0 * x - 2.0 * p.real()) / denominator), 1e-14);
      EXPECT_LT(std::abs(phi(k, 2 * i + 1) - -2.0 * p.imag() / denominator), 1e-14);
    }
    EXPECT_LT(std::abs(phi(k, 4) - 1.0 / (x + 4.0)), 1e-15);
  }
}

TEST(PoleSet, ZerosAreWhereTheSumVanishes) {
  Eigen::VectorXd c(5);
  c << 0.3, -0.7, 0.2, 0.4, -1.5;
  const Eigen::VectorXcd zeros = zeros_of_sum(kPoles, c);
  ASSERT_EQ(zeros.size(), 5);
  const SplitMatrix at_zeros = partial_fractions(kPoles, zeros);
  for (Eigen::Index k = 0; k < 5; ++k) {
    Complex sum = 1.0;
    for (Eigen::Index i = 0; i < 5; ++i) sum += c[i] * at_zeros(k, i);
    EXPECT_LT(std::abs(sum), 1e-11) << zeros[k];
  }
  // All of them: the sum of the zeros is the poles' less the sum of the residues.
  EXPECT_NEAR(zeros.sum().real(), 2.0 * (-0.1 - 0.3) - 4.0 - (2.0 * (0.3 + 0.2) - 1.5), 1e-12);
}

TEST(PoleSet, NothingBesideOneLeavesThePolesWhereTheyAre) {
  const Eigen::VectorXcd zeros = zeros_of_sum(kPoles, Eigen::VectorXd::Zero(5));
  for (const Complex p : {kPoles.pairs[0], kPoles.pairs[1], Complex(-4.0, 0.0)})
    EXPECT_TRUE(std::ranges::any_of(zeros, [&](Complex zero) {
      return std::abs(zero - p) < 1e-13;
    })) << p;
}

}  // namespace stageid::test_pole_set
