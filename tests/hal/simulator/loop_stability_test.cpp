#include "hal/simulator/loop_stability.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/hal/simulator/closed_loop_model.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_loop_stability {

test::SimulatedSpec with_crossovers(double factor) {
  test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  for (AxisController& axis : spec.controller.axes) {
    axis.crossover_hz *= factor;
    axis.gain *= factor * factor;
  }
  return spec;
}

/// Growth per sample of a free motion of the loop, by steps of the matrix. Eigenvalues of a matrix in metres and
/// newtons would lose half their digits.
double growth(const Eigen::MatrixXd& a) {
  constexpr int kSteps = 20000;
  Eigen::VectorXd x = Eigen::VectorXd::Ones(a.rows());
  double half = 0.0;
  double log_size = 0.0;
  for (int n = 1; n <= kSteps; ++n) {
    x = a * x;
    const double size = x.norm();
    log_size += std::log(size);
    x /= size;
    if (n == kSteps / 2) half = log_size;
  }
  return std::exp((log_size - half) / (kSteps / 2));
}

// The reference uses the general matrix exponential and the actuators and sensors themselves.
TEST(LoopStability, TheOutermostPoleIsThatOfTheWholeLoop) {
  for (const double factor : {0.5, 1.0, 3.0, 10.0}) {
    const test::SimulatedSpec spec = with_crossovers(factor);
    const double reference = growth(test::closed_loop_model(spec).a);
    const LoopStability loop = loop_stability(spec, spec.plant);
    ASSERT_TRUE(loop.tested);
    EXPECT_NEAR(loop.largest_pole, reference, 2e-4) << factor;
    EXPECT_EQ(loop.stable(), reference < 1.0) << factor;
  }
}

TEST(LoopStability, TheShippedStageHasMarginAndAFasterOneHasNot) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const LoopStability shipped = loop_stability(spec, spec.plant);
  EXPECT_TRUE(shipped.stable());
  EXPECT_LT(shipped.largest_sensitivity, 1.75);  // the stage file states 1.7, per channel
  EXPECT_FALSE(loop_stability(with_crossovers(10.0), spec.plant).stable());
}

// One axis, L = l: S = 1 / |1 + l|. Two axes in other units give the same.
TEST(LoopStability, SensitivityDoesNotDependOnUnits) {
  Eigen::MatrixXcd L{{std::complex<double>(-0.5, 0.0), 0.3}, {0.1, std::complex<double>(0.2, 1.0)}};
  const double size = largest_sensitivity(L);
  const Eigen::Vector2d units(1e-6, 1.0);
  EXPECT_NEAR(largest_sensitivity(units.asDiagonal() * L * units.cwiseInverse().asDiagonal()), size,
              1e-9 * size);
  EXPECT_DOUBLE_EQ(largest_sensitivity(L.topLeftCorner(1, 1)), 2.0);
}

}  // namespace stageid::test_loop_stability
