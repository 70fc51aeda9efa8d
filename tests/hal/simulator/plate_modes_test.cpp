#include "hal/simulator/plate_modes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace stageid::test_plate_modes {

// omega a^2 sqrt(rho h / D) of the completely free square plate, nu = 0.3: K. M. Liew, Y. Xiang and S. Kitipornchai,
// J. Sound Vib. 163 (1993), and others, to the digits on which they agree.
TEST(PlateModes, AgreeWithPublishedFrequenciesOfTheFreeSquarePlate) {
  constexpr std::array<double, 10> kPublished = {13.468, 19.596, 24.270, 34.801, 34.801,
                                                 61.093, 61.093, 63.687, 69.265, 77.172};
  const PlateModes plate({1.0, 1.0, 0.3}, 10);
  for (int i = 0; i < 10; ++i) {
    // Half a unit of the last digit, and as much for the convergence of their own expansions.
    EXPECT_NEAR(plate.wave_parameter(i), kPublished[i], 1.2e-3) << i;
  }
}

// With nu = 0, bending along x does not curve the plate along y. The modes of the plate then include those of the
// free-free beam, cosh(b) cos(b) = 1, omega a^2 sqrt(EI / rho A) = b^2, exactly.
TEST(PlateModes, WithoutPoissonEffectContainTheFreeBeam) {
  constexpr std::array<double, 3> kBeam = {4.730040744862704, 7.853204624095838, 10.99560783800167};
  const PlateModes plate({2.0, 1.0, 0.0}, 20);
  for (const double b : kBeam) {
    double nearest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < plate.count(); ++i)
      nearest = std::min(nearest, std::abs(plate.wave_parameter(i) * 4.0 / (b * b) - 1.0));
    // Rounding relative to the largest entry of the stiffness, 17^8 = 7e9 against b^4 = 500.
    EXPECT_LT(nearest, 1e-8) << "beam parameter " << b;
  }
}

TEST(PlateModes, ScaleWithTheInverseSquareOfTheSize) {
  const PlateModes small({0.5, 0.6, 0.2}, 20);
  const PlateModes large({1.0, 1.2, 0.2}, 20);
  for (int i = 0; i < 20; ++i)
    EXPECT_NEAR(small.wave_parameter(i) / large.wave_parameter(i), 4.0, 1e-9);
}

TEST(PlateModes, TurnWithThePlate) {
  const PlateModes wide({0.7, 0.5, 0.25}, 15);
  const PlateModes high({0.5, 0.7, 0.25}, 15);
  for (int i = 0; i < 15; ++i) {
    EXPECT_NEAR(wide.wave_parameter(i) / high.wave_parameter(i), 1.0, 1e-9);
    EXPECT_NEAR(wide.shape(i, 0.3, -0.1), high.shape(i, -0.1, 0.3), 1e-6) << i;
  }
}

// Weight of point `i` of 0 ... `intervals` (even) in Simpson's rule for the mean over the range.
double simpson(int i, int intervals) {
  const double weight = i == 0 || i == intervals ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
  return weight / (3.0 * intervals);
}

// Simpson's error is (h/2)^4 / 180 of the fourth derivative of the integrand; a product of two
// shapes with at most five half waves each has (10 pi)^4 = 1e6 of it: 1e-6 with 100 intervals.
TEST(PlateModes, AreOrthonormalAndFreeOfRigidMotion) {
  constexpr int kIntervals = 100;
  constexpr int kCount = 12;
  const double a = 0.6;
  const double b = 0.606;
  const PlateModes plate({a, b, 0.17}, kCount);
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(kCount, kCount + 3);
  for (int ix = 0; ix <= kIntervals; ++ix) {
    for (int iy = 0; iy <= kIntervals; ++iy) {
      const double x = a * (1.0 * ix / kIntervals - 0.5);
      const double y = b * (1.0 * iy / kIntervals - 0.5);
      Eigen::VectorXd values(kCount + 3);
      values.tail<3>() << 1.0, x / a, y / b;
      for (int i = 0; i < kCount; ++i) values[i] = plate.shape(i, x, y);
      gram += simpson(ix, kIntervals) * simpson(iy, kIntervals) * values.head(kCount) *
              values.transpose();
    }
  }
  const Eigen::MatrixXd flexible = gram.leftCols(kCount);
  EXPECT_LT((flexible - Eigen::MatrixXd::Identity(kCount, kCount)).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_LT(gram.rightCols(3).cwiseAbs().maxCoeff(), 1e-5);
}

TEST(PlateModes, OfANearlySquarePlateComeInNearPairs) {
  const PlateModes square({0.6, 0.6, 0.17}, 17);
  const PlateModes stage({0.6, 0.606, 0.17}, 17);
  EXPECT_NEAR(square.wave_parameter(4) / square.wave_parameter(3), 1.0, 1e-9);
  EXPECT_GT(stage.wave_parameter(4) / stage.wave_parameter(3), 1.005);
  EXPECT_LT(stage.wave_parameter(4) / stage.wave_parameter(3), 1.01);
}

TEST(PlateModes, RefuseWhatIsNoPlate) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(PlateModes({0.0, 1.0, 0.3}, 3), std::invalid_argument);
  EXPECT_THROW(PlateModes({1.0, nan, 0.3}, 3), std::invalid_argument);
  EXPECT_THROW(PlateModes({1.0, 1.0, 0.5}, 3), std::invalid_argument);
  EXPECT_THROW(PlateModes({1.0, 1.0, nan}, 3), std::invalid_argument);
  EXPECT_THROW(PlateModes({1.0, 1.0, 0.3}, -1), std::invalid_argument);
  EXPECT_THROW(PlateModes({1.0, 1.0, 0.3}, PlateModes::max_count() + 1), std::invalid_argument);
}

}  // namespace stageid::test_plate_modes
