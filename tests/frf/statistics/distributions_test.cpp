#include "frf/statistics/distributions.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace stageid::test_distributions {

// scipy.stats.f.logsf(x, 2 a, 2 b); the second overflows without intermediate scaling.
TEST(Distributions, TailsAndMomentsAreThoseOfScipy) {
  EXPECT_NEAR(log_tail_of_f(1.2, 130, 1170.0), -3.8900547289422773, 1e-9);
  EXPECT_NEAR(log_tail_of_f(1.05, 2000, 20000.0), -4.026592717858111, 1e-7);
  EXPECT_NEAR(log_tail_of_f(0.9, 5, 7.5), -0.5881163002608537, 1e-12);
  // scipy.stats.chi2.sf(2 h, 2 K)
  EXPECT_NEAR(tail_of_evidence(12.3, 7), 0.03872784616227062, 1e-12);
  EXPECT_EQ(tail_of_evidence(0.0, 7), 1.0);
  EXPECT_EQ(tail_of_evidence(3.0, 0), 1.0);
  // scipy.stats.chi2.sf(x, n)
  EXPECT_NEAR(tail_of_chi_square(4.0, 4.0), 0.40600584970983794, 1e-14);
  EXPECT_NEAR(tail_of_chi_square(52.0, 36.0), 0.04110463210330187, 1e-14);
  EXPECT_NEAR(tail_of_chi_square(8400.0, 8000.0), 0.0009156555871932195, 1e-14);
  EXPECT_NEAR(std::log(tail_of_chi_square(38.0, 4.0)), -16.00426772644601, 1e-12);
  // scipy.special.digamma(x) - log(x), polygamma(1, x)
  EXPECT_NEAR(mean_of_log_power(1.0), -0.5772156649015329, 1e-14);
  EXPECT_NEAR(mean_of_log_power(2.5), -0.2131340912289118, 1e-14);
  EXPECT_NEAR(mean_of_log_power(25.0), -0.02013331201622659, 1e-14);
  EXPECT_NEAR(variance_of_log_power(1.0), 1.6449340668482266, 1e-14);
  EXPECT_NEAR(variance_of_log_power(2.5), 0.4903577561002349, 1e-14);
  EXPECT_NEAR(variance_of_log_power(25.0), 0.04081066325722558, 1e-14);
  EXPECT_FALSE(std::isfinite(mean_of_log_power(0.0)));
  EXPECT_FALSE(std::isfinite(variance_of_log_power(0.0)));
}

TEST(Distributions, TailOfChiSquareNeverThrows) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(tail_of_chi_square(-1e-12, 4.0), 1.0);  // a difference of sums of squares
  EXPECT_EQ(tail_of_chi_square(0.0, 4.0), 1.0);
  EXPECT_EQ(tail_of_chi_square(1e300, 4.0), 0.0);
  EXPECT_EQ(tail_of_chi_square(infinity, 4.0), 0.0);
  EXPECT_TRUE(std::isnan(tail_of_chi_square(nan, 4.0)));
  EXPECT_TRUE(std::isnan(tail_of_chi_square(4.0, 0.0)));
  EXPECT_TRUE(std::isnan(tail_of_chi_square(4.0, nan)));
}

TEST(Distributions, AgreesWithClosedForms) {
  // F(2, 2 b): P(F > x) = (1 + x / b)^-b. Chi-square with two degrees of freedom: exp(-h).
  EXPECT_NEAR(log_tail_of_f(2.5, 1, 7.0), -7.0 * std::log1p(2.5 / 7.0), 1e-14);
  EXPECT_NEAR(tail_of_evidence(3.0, 1), std::exp(-3.0), 1e-15);
  // Chi-square with four: exp(-h) (1 + h).
  EXPECT_NEAR(tail_of_evidence(3.0, 2), 4.0 * std::exp(-3.0), 1e-15);
  // F(4, 4): P(F > x) = I_w(2, 2) with w = 1 / (1 + x), and I_w(2, 2) = w^2 (3 - 2 w).
  const double w = 1.0 / (1.0 + 1.7);
  EXPECT_NEAR(log_tail_of_f(1.7, 2, 2.0), std::log(w * w * (3.0 - 2.0 * w)), 1e-14);
}

// Noise-free data: 1 - w rounds to one, and F exceeds the largest double.
TEST(Distributions, StaysANumberHoweverCleanTheDataAre) {
  EXPECT_NEAR(log_tail_of_f(1e20, 1, 7.0), -7.0 * std::log1p(1e20 / 7.0), 1e-10);
  EXPECT_NEAR(log_tail_of_f(1e20, 2, 2.0), std::log(3.0) - 2.0 * std::log1p(1e20), 1e-10);
  EXPECT_NEAR(log_tail_of_f(1e-20, 1, 7.0), -1e-20, 1e-34);
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double x : {1e300, 1e308, infinity}) {
    EXPECT_TRUE(std::isfinite(log_tail_of_f(x, 3, 2.0))) << x;
    EXPECT_LT(log_tail_of_f(x, 3, 2.0), -1000.0) << x;
  }
  EXPECT_EQ(log_tail_of_f(0.0, 3, 2.0), 0.0);
  EXPECT_EQ(tail_of_evidence(infinity, 5), 0.0);
  EXPECT_EQ(tail_of_evidence(1e300, 5), 0.0);
}

}  // namespace stageid::test_distributions
