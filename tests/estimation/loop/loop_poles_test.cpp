#include "estimation/loop/loop_poles.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/estimation/loop_cases.hpp"

namespace stageid::test_loop_poles {

using test::FreeMass;

LoopController scaled(LoopController controller, double gain) {
  controller.system.C *= gain;
  controller.system.D *= gain;
  return controller;
}

/// Turns of a function around 0 on the circle |z| = radius, both counter-clockwise.
template <typename Function>
int turns_on(double radius, const Function& f) {
  constexpr int kSteps = 200000;
  double angle = 0.0;
  std::complex<double> last = f(radius);
  for (int i = 1; i <= kSteps; ++i) {
    const std::complex<double> value = f(std::polar(radius, 2.0 * std::numbers::pi * i / kSteps));
    angle += std::arg(value / last);
    last = value;
  }
  return static_cast<int>(std::lround(angle / (2.0 * std::numbers::pi)));
}

TEST(LoopPoles, AreTheRootsOfTheCharacteristicPolynomial) {
  const FreeMass stage;
  for (const double gain : {0.5, 1.0, 3.0, 40.0}) {
    const Eigen::VectorXcd roots = stage.poles(gain);
    const LoopPoles poles = loop_poles(stage.model(), scaled(stage.controller(), gain));
    EXPECT_NEAR(poles.largest_pole, roots.cwiseAbs().maxCoeff(), 1e-9) << gain;
    EXPECT_EQ(poles.unstable_closed_loop, (roots.cwiseAbs().array() > 1.0).count()) << gain;
    EXPECT_EQ(poles.unstable_open_loop, 0);
    const int turns =
        turns_on(1.0 + 1e-3, [&](std::complex<double> z) { return 1.0 + gain * stage.loop(z); });
    // By the argument principle, 1 + L turns by the zeros minus the poles within the circle. Both are as many as the
    // degree of L, and the zeros outside are missing.
    EXPECT_EQ(poles.encirclements(), -turns) << gain;
  }
  EXPECT_TRUE(loop_poles(stage.model(), stage.controller()).stable());
  EXPECT_FALSE(loop_poles(stage.model(), scaled(stage.controller(), 40.0)).stable());
}

TEST(LoopPoles, DelaysOfAnyChannelAreStates) {
  const FreeMass stage;
  AdditiveModel model = stage.model();
  model.input_delay_s = Eigen::VectorXd::Constant(1, 3.0 * stage.period_s);
  const LoopPoles input = loop_poles(model, stage.controller());
  // 1 + L(z) vanishes at the pole.
  const std::complex<double> z =
      std::polar(input.largest_pole, 2.0 * std::numbers::pi * input.pole_hz * stage.period_s);
  EXPECT_LT(std::abs(1.0 + stage.loop(z) * std::pow(z, -3.0)), 1e-6);
  model.input_delay_s = Eigen::VectorXd::Constant(1, stage.period_s);
  model.output_delay_s = Eigen::VectorXd::Constant(1, 2.0 * stage.period_s);
  EXPECT_NEAR(loop_poles(model, stage.controller()).largest_pole, input.largest_pole, 1e-9);
}

TEST(LoopPoles, DelaysThatDifferBetweenChannelsAreAtTheirChannels) {
  AdditiveModel model = test::model_of({});
  const double T = 1.0 / test::kTrackedRateHz;
  model.input_delay_s = T * Eigen::VectorXd{{1.0, 2.0, 0.0}};
  model.output_delay_s = T * Eigen::VectorXd{{0.0, 2.4}};
  const LoopController controller = test::tracked_controller();
  const LoopPoles poles = loop_poles(model, controller);
  ASSERT_TRUE(poles.stable());
  // At the gain at which the loop becomes unstable, det(I + L) is zero at the frequency of the pole.
  double low = 1.0;
  double high = 100.0;
  while (high - low > 1e-9) {
    const double middle = 0.5 * (low + high);
    (loop_poles(model, scaled(controller, middle)).stable() ? low : high) = middle;
  }
  const LoopController limit = scaled(controller, high);
  const double at_hz = loop_poles(model, limit).pole_hz;
  const Eigen::VectorXd hz = Eigen::VectorXd::Constant(1, at_hz);
  EXPECT_LT(std::abs(loop_points(model, limit, hz, false)[0].determinant), 1e-5);
}

TEST(LoopPoles, AnUnstableControllerIsCountedAndANegativeDelayRefused) {
  const FreeMass stage;
  LoopController controller = stage.controller();
  controller.system.A(0, 0) = 1.2;
  AdditiveModel model = stage.model();
  EXPECT_EQ(loop_poles(model, controller).unstable_open_loop, 1);
  model.input_delay_s = Eigen::VectorXd::Constant(1, -stage.period_s);
  EXPECT_THROW(loop_poles(model, controller), std::invalid_argument);
}

}  // namespace stageid::test_loop_poles
