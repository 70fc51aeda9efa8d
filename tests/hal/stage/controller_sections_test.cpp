#include "hal/stage/controller_sections.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "excitation/decompositions/decompositions.hpp"
#include "hal/simulator/loop_stability.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "tests/hal/measured_response.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_controller_sections {

constexpr double kRateHz = 1000.0;

std::complex<double> on_circle(double frequency_hz) {
  return std::polar(1.0, 2.0 * std::numbers::pi * frequency_hz / kRateHz);
}

std::complex<double> polynomial(const std::vector<double>& coefficients, std::complex<double> z) {
  std::complex<double> sum = 0.0;
  for (const double c : coefficients) sum = sum * z + c;
  return sum;
}

MotionControllerSpec open_spec(Eigen::Index actuators, Eigen::Index sensors) {
  MotionControllerSpec spec;
  spec.sample_rate_hz = kRateHz;
  spec.sensor_decoupling.resize(0, sensors);
  spec.actuator_decoupling.resize(actuators, 0);
  return spec;
}

MotionControllerSpec with_transfer(const std::vector<double>& numerator,
                                   const std::vector<double>& denominator) {
  MotionControllerSpec spec = open_spec(1, 1);
  spec.transfer = {{0, 0, numerator, denominator}};
  return spec;
}

// Pure delays, odd and even orders, complex and repeated roots, fewer zeros than poles.
TEST(TransferSections, TheirProductIsTheQuotient) {
  const std::vector<std::pair<std::vector<double>, std::vector<double>>> cases = {
      {{2.5}, {1.0}},
      {{2.5}, {5.0, 0.0, 0.0}},
      {{0.0, 0.0, 3.0}, {0.0, 2.0, -1.9}},
      {{1.0, -0.5}, {1.0, -0.9}},
      {{1.0, -0.5}, {1.0, -1.6, 0.8}},
      {{1.0, -1.2, 0.7, 0.3}, {1.0, -2.1, 1.5, -0.38}},
      {{3.0, -2.0, 0.4}, {1.0, -2.4, 1.92, -0.512}},
      {{1.0, 0.2, 0.1, 0.7, -0.3}, {2.0, -1.0, 0.4, 0.1, -0.2, 0.05}},
      {{0.005}, {1.0, -1.0}}};
  for (const auto& [numerator, denominator] : cases) {
    MotionController controller(with_transfer(numerator, denominator));
    for (const double f : {1.0, 60.0, 220.0, 490.0}) {
      const std::complex<double> z = on_circle(f);
      const std::complex<double> exact = polynomial(numerator, z) / polynomial(denominator, z);
      EXPECT_LT(std::abs(-controller.response(f)(0, 0) - exact), 2e-9 * std::abs(exact))
          << numerator.size() << "/" << denominator.size() << " " << f;
    }
  }
}

TEST(TransferSections, RunAsTheirQuotient) {
  const std::vector<double> numerator = {1.0, -1.2, 0.7};
  const std::vector<double> denominator = {1.0, -2.1, 1.5, -0.38};
  MotionController controller(with_transfer(numerator, denominator));
  const std::complex<double> z = on_circle(5.0 * kRateHz / 100.0);
  const std::complex<double> exact = -polynomial(numerator, z) / polynomial(denominator, z);
  const Eigen::VectorXcd measured =
      test::measured_response(controller, Eigen::VectorXd::Ones(1), {5, 100, 20});
  EXPECT_LT(std::abs(measured[0] - exact), 1e-9 * std::abs(exact));
}

TEST(TransferSections, RefuseWhatCannotBeComputed) {
  const auto refused = [](const std::vector<double>& numerator,
                          const std::vector<double>& denominator, const char* text) {
    EXPECT_THAT(
        [&] {
          transfer_sections({0, 0, numerator, denominator});
        },
        test::refuses<std::invalid_argument>(text));
  };
  refused({1.0, 0.0, 0.0}, {1.0, -0.5}, "2 zeros and 1 poles");
  refused({1.0}, {0.0, 0.0}, "denominator");
  refused({std::nan("")}, {1.0}, "not finite");
}

ControllerStateSpace random_system(Eigen::Index n, Eigen::Index actuators, Eigen::Index sensors) {
  test::RandomNumbers random(3);
  ControllerStateSpace s;
  s.a = random_matrix(random, n, n);
  s.a *= 0.8 / svd(s.a, 0).singularValues()[0];
  s.b = random_matrix(random, n, sensors);
  s.c = random_matrix(random, actuators, n);
  s.d = random_matrix(random, actuators, sensors);
  return s;
}

TEST(StateSpaceController, RunsAsItsMatricesSay) {
  MotionControllerSpec spec = open_spec(3, 2);
  spec.state_space = random_system(11, 3, 2);
  const ControllerStateSpace& s = spec.state_space;
  MotionController controller(spec);
  const Eigen::VectorXd direction{{1.0, -0.4}};
  const Eigen::VectorXcd into_states = s.b * direction;
  const Eigen::VectorXcd direct = s.d * direction;
  const Eigen::MatrixXcd c = s.c.cast<std::complex<double>>();
  for (const int line : {1, 7, 31}) {
    const std::complex<double> z = on_circle(line * kRateHz / 100.0);
    const Eigen::VectorXcd states =
        solve(z * Eigen::MatrixXcd::Identity(11, 11) - s.a, into_states);
    const Eigen::VectorXcd exact = -c * states - direct;
    EXPECT_LT((test::measured_response(controller, direction, {line, 100, 20}) - exact).norm(),
              1e-9 * exact.norm());
    const Eigen::MatrixXcd response = controller.response(line * kRateHz / 100.0);
    EXPECT_LT((response * direction.cast<std::complex<double>>() - exact).norm(),
              1e-9 * exact.norm());
  }
}

TEST(StateSpaceController, RefusesMatricesThatDoNotFit) {
  MotionControllerSpec spec = open_spec(3, 2);
  spec.state_space = random_system(4, 3, 2);
  spec.state_space.b.conservativeResize(4, 3);
  EXPECT_THAT([&] { MotionController{spec}; },
              test::refuses<std::invalid_argument>("matrix B is 4 x 3; expected 4 x 2"));
}

TEST(StateSpaceController, OnlyAFeedthroughIsAController) {
  MotionControllerSpec spec = open_spec(2, 2);
  spec.state_space.a.resize(0, 0);
  spec.state_space.b.resize(0, 2);
  spec.state_space.c.resize(2, 0);
  spec.state_space.d = Eigen::Matrix2d{{1.0, 2.0}, {3.0, 4.0}};
  MotionController controller(spec);
  const Eigen::Vector2d y(1.0, -1.0);
  Eigen::Vector2d u;
  controller.update(y.data(), u.data());
  EXPECT_EQ(u, -(spec.state_space.d * y));
  EXPECT_TRUE(controller.acts());
}

/// The controller of a stage, by its own realization.
test::SimulatedSpec in_state_space(const test::SimulatedSpec& stage) {
  test::SimulatedSpec out = stage;
  out.controller = open_spec(static_cast<Eigen::Index>(stage.info.actuators.size()),
                             static_cast<Eigen::Index>(stage.info.sensors.size()));
  out.controller.sample_rate_hz = stage.controller.sample_rate_hz;
  out.controller.state_space = MotionController(stage.controller).realization();
  return out;
}

TEST(StateSpaceController, TheRealizationOfAxesIsTheSameController) {
  const test::SimulatedSpec axes = test::silent_wafer_stage_spec();
  const test::SimulatedSpec matrices = in_state_space(axes);
  const MotionController one(axes.controller);
  const MotionController other(matrices.controller);
  for (const double f : {0.5, 30.0, 400.0, 4000.0})
    EXPECT_LT((one.response(f) - other.response(f)).norm(), 1e-8 * one.response(f).norm()) << f;
}

TEST(StateSpaceController, TheLoopIsTestedAndGuardedInAnyForm) {
  const test::SimulatedSpec axes = test::silent_wafer_stage_spec();
  const test::SimulatedSpec matrices = in_state_space(axes);
  const LoopStability one = loop_stability(axes, axes.plant);
  const LoopStability other = loop_stability(matrices, matrices.plant);
  ASSERT_TRUE(other.tested);
  EXPECT_NEAR(other.largest_pole, one.largest_pole, 1e-6);
  EXPECT_NEAR(other.largest_sensitivity, one.largest_sensitivity, 1e-6 * one.largest_sensitivity);

  test::SimulatedSpec wrong = matrices;
  wrong.controller.state_space.c *= -1.0;
  wrong.controller.state_space.d *= -1.0;
  EXPECT_FALSE(loop_stability(wrong, wrong.plant).stable());

  const RigidMotion of_axes = rigid_motion(axes.controller, axes.info.actuators, axes.info.sensors);
  const RigidMotion of_matrices = rigid_motion(matrices.controller, axes.info.actuators,
                                               axes.info.sensors, axes.plant.axis_inertia());
  EXPECT_LT((of_matrices.acceleration_per_n - of_axes.acceleration_per_n).norm(),
            0.1 * of_axes.acceleration_per_n.norm());
  EXPECT_LT((of_matrices.force_per_acceleration - of_axes.force_per_acceleration).norm(),
            0.1 * of_axes.force_per_acceleration.norm());
  EXPECT_NEAR(of_matrices.bandwidth_rad_s / of_axes.bandwidth_rad_s, 1.0, 0.1);
  EXPECT_EQ(rigid_motion(matrices.controller, axes.info.actuators, axes.info.sensors)
                .acceleration_per_n.size(),
            0);  // the inertia is unknown
}

TEST(PeerController, ComputesNothing) {
  MotionControllerSpec spec = open_spec(2, 1);
  spec.by_peer = true;
  MotionController controller(spec);
  const double y = 7.0;
  Eigen::Vector2d u(1.0, 1.0);
  controller.update(&y, u.data());
  EXPECT_EQ(u, Eigen::Vector2d::Zero());
  EXPECT_FALSE(controller.acts());
}

TEST(FeedForward, RisesOnceTheLoopIsClosedAndStays) {
  MotionControllerSpec spec = open_spec(2, 1);
  spec.feed_forward_n = Eigen::Vector2d(10.0, -4.0);
  spec.feed_forward_ramp_s = 0.009;
  MotionController controller(spec);
  EXPECT_EQ(controller.feed_forward_samples(), 10U);
  const double y = 0.0;
  Eigen::Vector2d u;
  for (int run = 0; run < 2; ++run) {
    controller.reset();
    for (int n = 1; n <= 20; ++n) {
      controller.update(&y, u.data());
      EXPECT_LT((u - std::min(0.1 * n, 1.0) * spec.feed_forward_n).norm(), 1e-12) << n;
    }
  }
  EXPECT_EQ(controller.response(10.0).norm(), 0.0);
  EXPECT_EQ(MotionController(open_spec(2, 1)).feed_forward_samples(), 0U);
}

}  // namespace stageid::test_controller_sections
