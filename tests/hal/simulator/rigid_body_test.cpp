#include "hal/simulator/rigid_body.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_rigid_body {

AxisController lead(double crossover_hz) {
  AxisController axis;
  axis.crossover_hz = crossover_hz;
  axis.lead_zero_hz = crossover_hz / 3.0;
  axis.lead_pole_hz = crossover_hz * 3.0;
  return axis;
}

// Against the motion of a real rotation: J is its first-order part, so the difference is of second
// order in the angle.
TEST(RigidBodyJacobian, IsTheFirstOrderMotionOfEveryChannel) {
  Channel channel;
  channel.position_m[0] = 0.3;
  channel.position_m[1] = -0.2;
  channel.position_m[2] = 0.15;
  channel.direction[0] = 0.6;
  channel.direction[1] = 0.0;
  channel.direction[2] = 0.8;
  const Eigen::MatrixXd J = rigid_body_jacobian({channel});
  ASSERT_EQ(J.rows(), 1);
  ASSERT_EQ(J.cols(), 6);
  const Eigen::Vector3d p(0.3, -0.2, 0.15);
  const Eigen::Vector3d d(0.6, 0.0, 0.8);
  const double h = 1e-5;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
    EXPECT_DOUBLE_EQ(J(0, axis), d[axis]);
    const Eigen::Vector3d moved = Eigen::AngleAxisd(h, unit) * p - p;
    EXPECT_NEAR(J(0, 3 + axis), d.dot(moved) / h, h);
  }
}

TEST(MotionControllerSpec, DecouplesTheWaferStage) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(6, 6);
  const Eigen::MatrixXd seen =
      spec.controller.sensor_decoupling * rigid_body_jacobian(spec.info.sensors);
  const Eigen::MatrixXd driven =
      rigid_body_jacobian(spec.info.actuators).transpose() * spec.controller.actuator_decoupling;
  EXPECT_LT((seen - identity).norm(), 1e-12);
  EXPECT_LT((driven - identity).norm(), 1e-12);
  EXPECT_EQ(spec.controller.sensor_decoupling.cols(), 7);
  EXPECT_EQ(spec.controller.actuator_decoupling.rows(), 17);
}

TEST(MotionControllerSpec, KeepsInPlaneAndOutOfPlaneApart) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  for (const Eigen::Index axis : {2, 3, 4}) {  // z, Rx, Ry
    EXPECT_LT(spec.controller.sensor_decoupling.row(axis).tail(3).norm(), 1e-12);
    EXPECT_LT(spec.controller.actuator_decoupling.col(axis).tail(4).norm(), 1e-12);
  }
  for (const Eigen::Index axis : {0, 1, 5}) {  // x, y, Rz
    EXPECT_LT(spec.controller.sensor_decoupling.row(axis).head(4).norm(), 1e-12);
    EXPECT_LT(spec.controller.actuator_decoupling.col(axis).head(13).norm(), 1e-12);
  }
}

TEST(MotionControllerSpec, ComputesTheGainOfUnitLoopGainAtTheCrossover) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const double inertia[6] = {20.0, 20.0, 20.0, 0.61206, 0.6, 1.21206};
  for (std::size_t i = 0; i < 6; ++i) {
    const AxisController& axis = spec.controller.axes[i];
    const double omega = 2.0 * std::numbers::pi * axis.crossover_hz;
    const double loop =
        std::abs(axis_response(axis, axis.crossover_hz)) / (inertia[i] * omega * omega);
    EXPECT_NEAR(loop, 1.0, 1e-12) << kRigidAxisNames[i];
  }
}

TEST(MotionControllerSpec, LeavesAGivenGainAndOpenAxesAlone) {
  const test::SimulatedSpec stage = test::silent_wafer_stage_spec();
  AxisController z = lead(20.0);
  z.gain = 123.0;
  const auto spec = motion_controller_spec(
      1e4, stage.info.actuators, stage.info.sensors,
      {AxisController{}, AxisController{}, z, AxisController{}, AxisController{}, AxisController{}},
      {0., 0., 0., 0., 0., 0.});
  EXPECT_EQ(spec.axes[2].gain, 123.0);
  EXPECT_EQ(spec.axes[0].gain, 0.0);
}

TEST(MotionControllerSpec, RefusesWhatCannotBeControlled) {
  const StageInfo stage = test::silent_wafer_stage_spec().info;
  const auto build = [&](const std::vector<Channel>& actuators, const std::vector<Channel>& sensors,
                         std::size_t closed, double inertia = 1.0, double crossover_hz = 20.0) {
    std::array<AxisController, 6> axes;
    axes[closed] = lead(crossover_hz);
    motion_controller_spec(1e4, actuators, sensors, axes,
                           {inertia, inertia, inertia, inertia, inertia, inertia});
  };
  const std::vector<Channel> vertical(stage.actuators.begin(), stage.actuators.begin() + 13);
  EXPECT_NO_THROW(build(vertical, stage.sensors, 2));
  EXPECT_THROW(build(vertical, stage.sensors, 0), std::invalid_argument);
  // Two z sensors measure heave and tilt only in combination.
  EXPECT_THROW(build(stage.actuators, {stage.sensors[0], stage.sensors[1]}, 2),
               std::invalid_argument);
  for (const double inertia : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(build(stage.actuators, stage.sensors, 2, inertia), std::invalid_argument);
  EXPECT_THROW(build(stage.actuators, stage.sensors, 2, 1.0, 6000.0), std::invalid_argument);
}

Channel channel(const char* unit, double gain, Eigen::Vector3d position = {0.1, 0.2, 0.0},
                Eigen::Vector3d direction = {0.0, 0.0, 1.0}) {
  Channel c;
  c.name = unit;
  c.unit = unit;
  c.gain = gain;
  for (int i = 0; i < 3; ++i) {
    c.position_m[i] = position[i];
    c.direction[i] = direction[i];
  }
  return c;
}

TEST(Units, GainsAndRotationsAreInTheJacobian) {
  const Eigen::MatrixXd jacobian = rigid_body_jacobian(
      {channel("N", 1.0), channel("A", 12.0), channel("Nm", 1.0), channel("rad", 2.0)});
  Eigen::MatrixXd expected(4, 6);
  expected << 0, 0, 1, 0.2, -0.1, 0,  //
      0, 0, 12, 2.4, -1.2, 0,         //
      0, 0, 0, 0, 0, 1,               //
      0, 0, 0, 0, 0, 2;
  EXPECT_LT((jacobian - expected).norm(), 1e-14);
}

// A controller in A per m, from geometry, crossover and mass: the same loop as in N.
TEST(Units, ALoopInAmperesIsThatInNewtons) {
  const std::vector<Channel> sensors = {channel("m", 1.0, {0, 0, 0}), channel("m/s^2", 1.0)};
  std::array<AxisController, kRigidAxes> axes;
  axes[2].crossover_hz = 10.0;
  axes[2].lead_zero_hz = 4.0;
  axes[2].lead_pole_hz = 40.0;
  const auto spec = [&](const Channel& actuator) {
    return motion_controller_spec(1000.0, {actuator}, sensors, axes, {2, 2, 2, 1, 1, 1});
  };
  const Channel newton = channel("N", 1.0, {0, 0, 0});
  const Channel ampere = channel("A", 8.0, {0, 0, 0});
  const Eigen::MatrixXcd in_n = MotionController(spec(newton)).response(20.0);
  const Eigen::MatrixXcd in_a = MotionController(spec(ampere)).response(20.0);
  EXPECT_LT((8.0 * in_a - in_n).norm(), 1e-12 * in_n.norm());
  EXPECT_EQ(in_n(0, 1), std::complex<double>(0.0));  // an acceleration is not a position
  const RigidMotion motion = rigid_motion(spec(ampere), {ampere}, sensors);
  EXPECT_NEAR(motion.acceleration_per_n(0, 0), 8.0 / 2.0, 1e-12);
  EXPECT_EQ(motion.acceleration_per_n(1, 0), 0.0);
  EXPECT_EQ(motion.contradiction.size(), 0);
}

}  // namespace stageid::test_rigid_body
