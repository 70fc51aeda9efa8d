#include "estimation/tracking/free_motion.hpp"

#include <gtest/gtest.h>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/estimation/tracked_stage.hpp"

namespace stageid::test_free_motion {

using test::LoopSpectra;
using test::model_of;
using test::tracked_lines_hz;

TrackedResponse response() { return {model_of({}), {}, tracked_lines_hz()}; }

/// What is left of a spectrum beside some motions with real factors, relative.
double left(const Eigen::MatrixXcd& spectrum, const Eigen::MatrixXcd& motions) {
  Eigen::MatrixXd columns(2 * motions.rows(), motions.cols());
  columns << motions.real(), motions.imag();
  Eigen::VectorXd y(columns.rows());
  y << spectrum.reshaped().real(), spectrum.reshaped().imag();
  return (y - columns * least_squares(pivoted_qr(columns), y)).norm() / y.norm();
}

// Against sums over the samples of decaying oscillations.
TEST(FreeMotions, ContainEveryFreeResponseOfTheirModeOnly) {
  const std::vector<Eigen::MatrixXcd> motions = free_motions(response());
  ASSERT_EQ(motions.size(), 5U) << "free body and four modes";
  for (std::size_t mode = 0; mode < 3; ++mode) {
    SCOPED_TRACE(mode);
    for (const auto& [a, b] : {std::pair{1.0, 0.0}, {-0.3, 2.0}}) {
      const Eigen::MatrixXcd spectrum = LoopSpectra::free_response(mode, a, b);
      EXPECT_EQ(motions[mode + 1].cols(), 2);
      EXPECT_LT(left(spectrum, motions[mode + 1]), 1e-10);
      EXPECT_GT(left(spectrum, motions[4]), 0.5);
    }
  }
  // General viscous damping: two outputs are moved in two ways.
  EXPECT_EQ(motions[4].cols(), 4);
}

// A parabola is what a constant force leaves: position, velocity and force differ from output to output.
TEST(FreeMotions, ContainTheMotionOfAFreeBody) {
  const Eigen::VectorXd lines_hz = tracked_lines_hz();
  Eigen::MatrixXcd spectrum = Eigen::MatrixXcd::Zero(2, lines_hz.size());
  for (int n = 0; n < 400; ++n)
    for (Eigen::Index k = 0; k < lines_hz.size(); ++k) {
      const std::complex<double> turn =
          std::polar(1.0, -2.0 * std::numbers::pi * lines_hz[k] * n / test::kTrackedRateHz);
      spectrum(0, k) += turn * (3.0 - 0.2 * n);
      spectrum(1, k) += turn * (1.0 + 0.1 * n - 0.003 * n * n);
    }
  EXPECT_LT(left(spectrum, free_motions(response()).front()), 1e-10);
}

}  // namespace stageid::test_free_motion
