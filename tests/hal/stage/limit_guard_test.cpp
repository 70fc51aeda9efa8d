#include "hal/stage/limit_guard.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <numbers>
#include <stdexcept>

#include "hal/stage/motion_controller.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/stages/stop_case.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_limit_guard {

using testing::HasSubstr;
using Kind = SimulationSpec::Fault::Kind;

/// A stage in closed loop without excitation; `push_n` acts on every actuator in every sample.
class GuardedLoop {
 public:
  explicit GuardedLoop(const test::SimulatedSpec& spec) : controller_(spec.controller) {
    auto watched = std::make_unique<test::WatchedStage>(spec);
    watch = watched.get();
    stage = std::make_unique<LimitedStage>(std::move(watched), spec.limits);
    driver = std::make_unique<test::Driver>(*stage);
    driver->start();
  }
  Outcome step(double push_n = 0.0) {
    controller_.update(driver->y.data(), driver->u.data());
    for (double& u : driver->u) u += push_n;
    return driver->step();
  }
  /// Runs until the outcome is not ok, for at most this number of samples.
  Outcome steps(int samples, double push_n = 0.0) {
    Outcome outcome = Outcome::ok;
    for (int n = 0; n < samples && outcome == Outcome::ok; ++n) outcome = step(push_n);
    return outcome;
  }
  /// Runs until the brake has ended. @return the number of samples
  int brake() {
    int samples = 0;
    while (step() == Outcome::braking) ++samples;
    stage->stop();
    return samples;
  }

  std::unique_ptr<LimitedStage> stage;
  const test::WatchedStage* watch = nullptr;
  std::unique_ptr<test::Driver> driver;

 private:
  MotionController controller_;
};

test::SimulatedSpec with_fault(Kind kind, double value, int channel = -1) {
  test::SimulatedSpec spec = test::stop_stage_spec();
  spec.simulation.faults = {{kind, channel, 100, 1, -1, value}};
  return spec;
}

TEST(LimitGuard, BrakesByThePredictionWhereTheSensorFailed) {
  test::SimulatedSpec spec = with_fault(Kind::sensor_offset, 300e-6);
  GuardedLoop loop(spec);
  ASSERT_EQ(loop.steps(100, 20.0), Outcome::ok);
  EXPECT_EQ(loop.step(), Outcome::braking);
  const double fast_m_s = loop.watch->speed_m_s();
  EXPECT_GT(fast_m_s, 5e-4);
  EXPECT_GT(loop.driver->y[0], 290e-6) << "the log shows what the sensor shows";
  // Five time constants of a loop of 60 Hz at 10 kHz.
  EXPECT_NEAR(loop.brake(), 5.0 / (2.0 * std::numbers::pi * 60.0) * 1e4, 2.0);
  EXPECT_LT(loop.watch->speed_m_s(), 0.01 * fast_m_s);
  EXPECT_EQ(loop.stage->emergency().cause.kind, LimitKind::sensor_jump);
  EXPECT_EQ(loop.stage->emergency().response, 1.0);
}

TEST(LimitGuard, CutsTheForcesOfAnAxisThatIsNotToBeBraked) {
  test::SimulatedSpec spec = with_fault(Kind::nan_sensor, 0.0, 0);
  spec.controller.axes[2].brake = false;
  spec.limits.motion = rigid_motion(spec.controller, spec.info.actuators, spec.info.sensors);
  GuardedLoop loop(spec);
  ASSERT_EQ(loop.steps(100, 20.0), Outcome::ok);
  EXPECT_EQ(loop.step(), Outcome::braking);
  EXPECT_EQ(loop.step(100.0), Outcome::braking);
  EXPECT_EQ(loop.driver->inputs.applied[0], 0.0);
}

TEST(LimitGuard, LearnsThatTheStageAnswersTheOtherWayRound) {
  test::SimulatedSpec spec = with_fault(Kind::actuator_gain, -1.0);
  GuardedLoop loop(spec);
  ASSERT_EQ(loop.steps(101, 2.0), Outcome::ok);
  ASSERT_EQ(loop.steps(2000), Outcome::braking);
  loop.brake();
  EXPECT_EQ(loop.stage->emergency().cause.kind, LimitKind::deviation);
  EXPECT_LT(loop.stage->emergency().response, -0.5);
  EXPECT_LT(loop.watch->largest_m, 2.0 * test::kStopWindow);
  EXPECT_LT(loop.watch->speed_m_s(), 1e-3);
  EXPECT_THAT(describe_stop(*loop.stage), HasSubstr("times the expected one; braked"));
}

TEST(LimitGuard, ASpeedLimitBrakes) {
  test::SimulatedSpec spec = test::stop_stage_spec();
  spec.limits.speed_m_s = Eigen::VectorXd::Constant(1, 2e-3);
  GuardedLoop loop(spec);
  EXPECT_EQ(loop.steps(200, 20.0), Outcome::braking);
  EXPECT_EQ(loop.stage->violation().kind, LimitKind::speed);
  loop.brake();
  EXPECT_LT(loop.watch->speed_m_s(), 1e-4);
}

TEST(LimitGuard, AStageThatCouldNotBeStoppedInTimeIsBraked) {
  test::SimulatedSpec spec = test::stop_stage_spec();
  GuardedLoop loop(spec);
  // A disturbance beyond the capability of the controller.
  EXPECT_EQ(loop.steps(200, 640.0), Outcome::braking);
  EXPECT_EQ(loop.stage->emergency().cause.kind, LimitKind::stopping_distance);
  loop.brake();
  EXPECT_LT(loop.watch->largest_m, 2.0 * test::kStopWindow);
}

TEST(LimitGuard, ARampThatDoesNotConvergeIsEndedByTheBrake) {
  GuardedLoop loop(test::stop_stage_spec(10.0));  // ten times the gain: unstable
  ASSERT_EQ(loop.steps(2000, 1.0), Outcome::limit);
  EXPECT_EQ(loop.stage->violation().kind, LimitKind::actuator);
  int samples = 0;
  Outcome outcome = Outcome::limit;
  for (; outcome == Outcome::limit && samples < 1000; ++samples) outcome = loop.step();
  EXPECT_EQ(outcome, Outcome::braking);
  loop.brake();
  EXPECT_LT(loop.watch->speed_m_s(), 1e-3);
}

// Four sensors and three motions out of plane: inconsistent sensors are detected.
TEST(LimitGuard, ASensorThatDriftsContradictsTheOthers) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  spec.limits.motion = rigid_motion(spec.controller, spec.info.actuators, spec.info.sensors);
  spec.simulation.faults = {{Kind::sensor_drift, 0, 100, 1, -1, 1e-3}};
  GuardedLoop loop(spec);
  EXPECT_EQ(loop.steps(6000), Outcome::braking);
  EXPECT_EQ(loop.stage->violation().kind, LimitKind::contradiction);
  EXPECT_LT(loop.watch->largest_m, 2.0 * spec.limits.position_window_m[0]);
}

// Feed-forward against gravity: the simulator has no weight, so the stage is played by hand, at rest.
TEST(LimitGuard, AWeightThatIsCarriedIsNotAMotion) {
  test::SimulatedSpec spec = test::stop_stage_spec();
  spec.limits.stuck_sensor_s = 0.0;
  const auto actuators = static_cast<Eigen::Index>(spec.info.actuators.size());
  const Eigen::VectorXd load = Eigen::VectorXd::Constant(
      actuators, 9.81 * spec.plant.mass_kg / static_cast<double>(actuators));
  constexpr int kRamp = 200;
  for (const bool carried : {false, true}) {
    LimitGuard guard(spec.limits, spec.info);
    if (carried) guard.carry(load, kRamp);
    std::vector<double> y(spec.info.sensors.size(), 0.0);
    Inputs inputs;
    inputs.y = y;
    inputs.valid = ~std::uint64_t{0};
    guard.start(inputs);
    LimitKind kind = LimitKind::none;
    for (int n = 1; n <= 2 * kRamp && kind == LimitKind::none; ++n) {
      guard.predict(std::min(1.0, static_cast<double>(n) / kRamp) * load.array());
      kind = guard.inspect(inputs).violation.kind;
    }
    EXPECT_EQ(kind == LimitKind::none, carried) << static_cast<int>(kind);
    if (!carried) continue;
    ASSERT_TRUE(guard.begin_brake());
    Eigen::ArrayXd u(actuators);
    guard.brake(u);
    EXPECT_LT((u.matrix() - load).norm(), 1e-9 * load.norm());  // a brake lets nothing fall
  }
  EXPECT_THROW(LimitGuard(spec.limits, spec.info).carry(Eigen::VectorXd::Ones(actuators + 1), 1),
               std::invalid_argument);
}

TEST(LimitGuard, BeyondAHardWindowItDoesNotMatterWhatElseIsWrong) {
  StageInfo info = test::stop_stage_spec().info;
  info.sensors = {{"first", "m"}, {"second", "m"}};
  StageLimits limits;
  limits.position_window_m = Eigen::Vector2d(1e-3, 1e-3);
  limits.speed_m_s = Eigen::Vector2d(1e-6, 1e-6);
  LimitGuard guard(limits, info);
  std::array<double, 2> y = {0.0, 0.0};
  Inputs inputs;
  inputs.y = y;
  inputs.valid = all_bits(2);
  guard.start(inputs);
  y = {1e-4, 0.0};
  EXPECT_EQ(guard.inspect(inputs).violation.kind, LimitKind::speed);
  y = {2e-4, 2.1e-3};
  const LimitGuard::Finding finding = guard.inspect(inputs);
  EXPECT_FALSE(finding.sound);
  EXPECT_EQ(finding.violation.kind, LimitKind::hard_position);
  EXPECT_EQ(finding.violation.channel, 1);
}

TEST(LimitGuard, WithoutAMotionNothingIsPredicted) {
  test::SimulatedSpec spec = with_fault(Kind::sensor_offset, 150e-6);
  spec.limits.motion = {};
  GuardedLoop loop(spec);
  EXPECT_EQ(loop.steps(1000), Outcome::limit) << "the controller's command, then the ramp";
  EXPECT_EQ(loop.stage->violation().kind, LimitKind::actuator);
}

TEST(LimitGuard, RefusesAMotionThatDoesNotFit) {
  const test::SimulatedSpec spec = test::stop_stage_spec();
  const auto make = [&](void (*change)(RigidMotion&)) {
    StageLimits limits = spec.limits;
    change(limits.motion);
    return LimitGuard(limits, spec.info);
  };
  EXPECT_NO_THROW(make([](RigidMotion&) {}));
  EXPECT_THROW(make([](RigidMotion& m) { m.bandwidth_rad_s = 0.0; }), std::invalid_argument);
  EXPECT_THROW(make([](RigidMotion& m) { m.force_per_acceleration.resize(2, 1); }),
               std::invalid_argument);
  EXPECT_THROW(make([](RigidMotion& m) { m.contradiction.setZero(2, 2); }), std::invalid_argument);
}

}  // namespace stageid::test_limit_guard
