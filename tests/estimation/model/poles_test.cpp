#include "estimation/model/poles.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimation/model/basis.hpp"

namespace stageid::test_poles {

using Complex = std::complex<double>;

TEST(Poles, TheDenominatorOfAModeIsItsTwoCoefficients) {
  const Eigen::VectorXd a = denominator_of(mode_poles(120.0, 0.03));
  const double omega = 2.0 * std::numbers::pi * 120.0;
  ASSERT_EQ(a.size(), 2);
  EXPECT_NEAR(a[0], 2.0 * 0.03 / omega, 1e-14 / omega);
  EXPECT_NEAR(a[1], 1.0 / (omega * omega), 1e-14 / (omega * omega));
  EXPECT_EQ(denominator_of({}).size(), 0);
}

TEST(Poles, ComeBackFromTheirDenominator) {
  std::vector<Complex> poles = {-300.0};
  for (const double f : {50.0, 210.0, 700.0, 900.0})
    for (const Complex pole : mode_poles(f, 0.01)) poles.push_back(pole);
  for (const Complex found : roots(denominator_of(poles))) {
    const double nearest = std::abs(*std::ranges::min_element(poles, [&](Complex l, Complex r) {
      return std::abs(l - found) < std::abs(r - found);
    }) - found);
    EXPECT_LT(nearest, 1e-11 * std::abs(found));
  }
}

// The delta method against central differences of the roots themselves.
TEST(Poles, DeviationsAreTheDifferencesOfTheRoots) {
  std::vector<Complex> poles = {-400.0};
  for (const double f : {60.0, 150.0})
    for (const Complex pole : mode_poles(f, 0.05)) poles.push_back(pole);
  const Eigen::VectorXd a = denominator_of(poles);
  for (Eigen::Index q = 0; q < a.size(); ++q) {
    const double step = 1e-6 * std::abs(a[q]);
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(a.size(), a.size());
    covariance(q, q) = step * step;
    const auto estimates = pole_estimates(a, covariance);
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(a.size(), q);
    const auto up = pole_estimates(a + step * unit, Eigen::MatrixXd());
    const auto down = pole_estimates(a - step * unit, Eigen::MatrixXd());
    ASSERT_EQ(estimates.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
      const double df = 0.5 * std::abs(up[i].natural_frequency_hz - down[i].natural_frequency_hz);
      EXPECT_NEAR(*estimates[i].natural_frequency_std_hz, df, 1e-4 * df + 1e-11) << i << ", " << q;
      if (estimates[i].damping_ratio == 1.0) {
        EXPECT_FALSE(estimates[i].damping_ratio_std);
        continue;
      }
      const double dz = 0.5 * std::abs(up[i].damping_ratio - down[i].damping_ratio);
      EXPECT_NEAR(*estimates[i].damping_ratio_std, dz, 1e-4 * dz + 1e-13) << i << ", " << q;
    }
    EXPECT_FALSE(up[0].natural_frequency_std_hz);
  }
}

}  // namespace stageid::test_poles
