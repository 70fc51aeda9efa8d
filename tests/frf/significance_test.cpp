#include "frf/significance.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace stageid {
namespace {

TEST(Significance, TailsAgreeWithClosedForms) {
  // F(2, 2 b): P(F > x) = (1 + x / b)^-b. Chi-square with two degrees of freedom: exp(-h).
  EXPECT_NEAR(log_tail_of_f(2.5, 1, 7.0), -7.0 * std::log1p(2.5 / 7.0), 1e-14);
  EXPECT_NEAR(tail_of_chi_square(3.0, 1), std::exp(-3.0), 1e-15);
  // Chi-square with four: exp(-h) (1 + h).
  EXPECT_NEAR(tail_of_chi_square(3.0, 2), 4.0 * std::exp(-3.0), 1e-15);
  // F(4, 4): P(F > x) = I_w(2, 2) with w = 1 / (1 + x), and I_w(2, 2) = w^2 (3 - 2 w).
  const double w = 1.0 / (1.0 + 1.7);
  EXPECT_NEAR(log_tail_of_f(1.7, 2, 2.0), std::log(w * w * (3.0 - 2.0 * w)), 1e-14);
  EXPECT_EQ(tail_of_chi_square(0.0, 5), 1.0);
}

}  // namespace
}  // namespace stageid
