#include "hal/stage/motion_controller.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>

#include "hal/simulator/rigid_body.hpp"
#include "tests/hal/measured_response.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_motion_controller {

AxisController full_axis() {
  AxisController axis;
  axis.crossover_hz = 40.0;
  axis.gain = 3.0;
  axis.integrator_hz = 3.0;
  axis.lead_zero_hz = 12.0;
  axis.lead_pole_hz = 150.0;
  axis.lowpass_hz = 320.0;
  axis.notches = {{700.0, 0.05, 0.5}, {1300.0, 0.1, 0.6}};
  return axis;
}

MotionControllerSpec single(const AxisController& axis) {
  MotionControllerSpec spec;
  spec.sample_rate_hz = 1e4;
  spec.sensor_decoupling = Eigen::MatrixXd::Identity(1, 1);
  spec.actuator_decoupling = Eigen::MatrixXd::Identity(1, 1);
  spec.axes = {axis};
  return spec;
}

std::complex<double> response(const AxisController& axis, double frequency_hz) {
  return -MotionController(single(axis)).response(frequency_hz)(0, 0);
}

// Prewarping maps the crossover exactly; the notches, mapped at their own frequency, differ there
// by their warping at 40 Hz only: (pi 40 / 1e4)^2 / 3 = 5e-5 of a small phase.
TEST(MotionController, IsExactAtTheCrossover) {
  AxisController axis = full_axis();
  axis.notches.clear();
  EXPECT_LT(std::abs(response(axis, 40.0) - axis_response(axis, 40.0)),
            1e-12 * std::abs(axis_response(axis, 40.0)));
}

TEST(MotionController, NotchesAreExactAtTheirOwnFrequency) {
  AxisController with = full_axis();
  AxisController without = full_axis();
  without.notches.clear();
  with.notches.resize(1);
  const std::complex<double> notch = response(with, 700.0) / response(without, 700.0);
  EXPECT_LT(std::abs(notch - 0.1), 1e-12);  // zero_damping / pole_damping
}

// Tustin maps f to the s-plane frequency f_c tan(pi f T) / tan(pi f_c T).
TEST(MotionController, FollowsTheTustinMapEverywhere) {
  AxisController axis = full_axis();
  axis.notches.clear();
  const double scale = 40.0 / std::tan(std::numbers::pi * 40.0 / 1e4);
  for (const double f : {0.01, 1.0, 40.0, 300.0, 2000.0, 4900.0}) {
    const double mapped = scale * std::tan(std::numbers::pi * f / 1e4);
    EXPECT_LT(std::abs(response(axis, f) - axis_response(axis, mapped)),
              1e-9 * std::abs(axis_response(axis, mapped)))
        << f;
  }
}

TEST(MotionController, LeavesOutFactorsOfFrequencyZero) {
  AxisController axis;
  axis.crossover_hz = 40.0;
  axis.gain = 2.5;
  EXPECT_NEAR(std::abs(response(axis, 123.0) - 2.5), 0.0, 1e-14);
}

// The response measured by running it: periodic input and output, after the transient of the slowest controller pole.
// The integrator is omitted, because its transient does not decay.
TEST(MotionController, RunsAsItsResponseSays) {
  test::SimulatedSpec stage = test::silent_wafer_stage_spec();
  for (AxisController& axis : stage.controller.axes) axis.integrator_hz = 0.0;
  stage.controller.axes[2].notches = full_axis().notches;
  MotionController controller(stage.controller);
  constexpr int kPeriod = 500;
  const Eigen::VectorXd direction = Eigen::VectorXd::LinSpaced(7, -1.0, 2.0);
  for (const int line : {1, 3, 50, 170}) {
    const Eigen::VectorXcd measured =
        test::measured_response(controller, direction, {line, kPeriod, 4});
    const Eigen::VectorXcd exact =
        controller.response(line * 1e4 / kPeriod) * direction.cast<std::complex<double>>();
    EXPECT_LT((measured - exact).norm(), 1e-9 * exact.norm()) << line;
  }
}

TEST(MotionController, IsLinearAndForgetsOnReset) {
  const test::SimulatedSpec stage = test::silent_wafer_stage_spec();
  MotionController controller(stage.controller);
  const Eigen::VectorXd y = Eigen::VectorXd::LinSpaced(7, -1e-6, 1e-6);
  const Eigen::VectorXd twice = 2.0 * y;
  Eigen::VectorXd first(17);
  Eigen::VectorXd second(17);
  for (int n = 0; n < 20; ++n) controller.update(y.data(), first.data());
  controller.reset();
  for (int n = 0; n < 20; ++n) controller.update(twice.data(), second.data());
  EXPECT_LT((second - 2.0 * first).norm(), 1e-12 * second.norm());
}

TEST(MotionController, DrivesNothingWhereAnAxisIsOpen) {
  AxisController open = full_axis();
  open.crossover_hz = 0.0;
  MotionController controller(single(open));
  const double y = 1.0;
  double u = 5.0;
  controller.update(&y, &u);
  EXPECT_EQ(u, 0.0);
}

// More axes and channels than fit one vector register.
TEST(MotionController, HasNoFixedSize) {
  constexpr int kAxes = 11;
  MotionControllerSpec spec;
  spec.sample_rate_hz = 1e3;
  spec.sensor_decoupling = Eigen::MatrixXd::Identity(kAxes, kAxes);
  spec.actuator_decoupling = Eigen::MatrixXd::Identity(kAxes, kAxes);
  for (int i = 0; i < kAxes; ++i) {
    AxisController axis;
    axis.crossover_hz = 10.0;
    axis.gain = i + 1.0;
    spec.axes.push_back(axis);
  }
  MotionController controller(spec);
  const Eigen::VectorXd y = Eigen::VectorXd::Ones(kAxes);
  Eigen::VectorXd u(kAxes);
  controller.update(y.data(), u.data());
  EXPECT_LT((u + Eigen::VectorXd::LinSpaced(kAxes, 1.0, kAxes)).norm(), 1e-12);
}

TEST(MotionController, RefusesWhatMakesNoSense) {
  const auto refuse = [](void (*change)(AxisController&)) {
    AxisController axis = full_axis();
    change(axis);
    EXPECT_THROW(MotionController{single(axis)}, std::invalid_argument);
  };
  refuse([](AxisController& a) { a.crossover_hz = 5000.0; });
  refuse([](AxisController& a) { a.crossover_hz = NAN; });
  refuse([](AxisController& a) { a.crossover_hz = -1.0; });
  refuse([](AxisController& a) { a.gain = NAN; });
  refuse([](AxisController& a) { a.integrator_hz = -1.0; });
  refuse([](AxisController& a) { a.lead_zero_hz = 6000.0; });
  refuse([](AxisController& a) { a.lead_pole_hz = 0.0; });
  refuse([](AxisController& a) { a.lowpass_hz = -3.0; });
  refuse([](AxisController& a) { a.lowpass_damping = 0.0; });
  refuse([](AxisController& a) { a.notches[0].frequency_hz = 0.0; });
  refuse([](AxisController& a) { a.notches[0].zero_damping = -0.1; });
  refuse([](AxisController& a) { a.notches[1].pole_damping = 0.0; });
  const auto refuse_spec = [](void (*change)(MotionControllerSpec&)) {
    MotionControllerSpec spec = single(full_axis());
    change(spec);
    EXPECT_THROW(MotionController{spec}, std::invalid_argument);
  };
  refuse_spec([](MotionControllerSpec& s) { s.sample_rate_hz = 0.0; });
  refuse_spec([](MotionControllerSpec& s) { s.sensor_decoupling.resize(2, 1); });
  refuse_spec([](MotionControllerSpec& s) { s.actuator_decoupling(0, 0) = NAN; });
  refuse_spec([](MotionControllerSpec& s) { s.axes.clear(); });
}

}  // namespace stageid::test_motion_controller
