#include "hal/stage/limited_stage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "tests/hal/stage/fake_stage.hpp"

namespace stageid::test_limited_stage {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

StageLimits generous() {
  StageLimits limits;
  limits.actuator_n = Eigen::VectorXd{{10.0, 20.0}};
  limits.slew_n_s = Eigen::VectorXd{{8e3, 1e5}};  // 8 and 100 N per sample at 1 kHz
  limits.thermal_rms_n = Eigen::VectorXd{{9.0, 15.0}};
  limits.thermal_time_constant_s = 0.05;
  limits.position_window_m = Eigen::VectorXd{{1e-3, 1e-3, 1e-3}};
  return limits;
}

struct LimitedStageTest : testing::Test {
  explicit LimitedStageTest(const StageLimits& limits = generous()) {
    auto fake = std::make_unique<test::FakeStage>(2, 3, 1e3);
    fake_ = fake.get();
    stage_ = std::make_unique<LimitedStage>(std::move(fake), limits);
    inputs_.y = y_;
  }
  void start() { stage_->start(42, inputs_); }
  Outcome give(double u0, double u1 = 0.0) {
    const std::vector<double> u{u0, u1};
    return stage_->exchange({inputs_.cycle, u}, inputs_, {});
  }
  const std::vector<double>& reached() const { return fake_->commands.back(); }
  std::string said() const { return describe(stage_->violation(), stage_->info()); }

  test::FakeStage* fake_ = nullptr;
  std::unique_ptr<LimitedStage> stage_;
  std::vector<double> y_ = std::vector<double>(3);
  Inputs inputs_;
};

TEST_F(LimitedStageTest, PassesOnWhatIsInsideAllLimits) {
  start();
  EXPECT_EQ(fake_->seed, 42U);
  EXPECT_EQ(give(7.9, -14.0), Outcome::ok);
  EXPECT_THAT(reached(), testing::ElementsAre(7.9, -14.0));
  EXPECT_EQ(stage_->violation().kind, LimitKind::none);
  EXPECT_TRUE(inputs_.applied.empty());
}

TEST_F(LimitedStageTest, PastTheHardWindowTheForcesAreCut) {
  start();
  fake_->measurement = {0.0, 1.9e-3, 0.0};
  EXPECT_EQ(give(1.0), Outcome::limit);
  fake_->measurement = {0.0, 2.1e-3, 0.0};  // twice the window
  EXPECT_EQ(give(1.0), Outcome::opened);
  give(1.0);
  EXPECT_THAT(reached(), testing::ElementsAre(0.0, 0.0));
  EXPECT_EQ(stage_->violation().kind, LimitKind::position);
  EXPECT_EQ(stage_->emergency().cause.kind, LimitKind::hard_position);
  EXPECT_THAT(describe_stop(*stage_), testing::HasSubstr("beyond the hard window"));
}

TEST_F(LimitedStageTest, ClampsAndSaysWhichActuatorWhereAndWhen) {
  start();
  EXPECT_EQ(give(0.0), Outcome::ok);
  EXPECT_EQ(give(1.0, -25.0), Outcome::limit);
  EXPECT_THAT(reached(), testing::ElementsAre(1.0, -20.0));
  EXPECT_THAT(inputs_.applied, testing::ElementsAre(1.0, -20.0));
  const LimitViolation& violation = stage_->violation();
  EXPECT_EQ(violation.kind, LimitKind::actuator);
  EXPECT_EQ(violation.channel, 1);
  EXPECT_EQ(violation.value, -25.0);
  EXPECT_EQ(violation.limit, 20.0);
  EXPECT_EQ(violation.cycle, 1U);
  EXPECT_FALSE(violation.of_sensor);
  EXPECT_EQ(said(), "actuator b: |u| would be 25 N, limit 20 N (cycle 1)");
}

TEST_F(LimitedStageTest, KeepsSayingSoUntilStopAndForgetsAtStart) {
  start();
  EXPECT_EQ(give(0.0, 21.0), Outcome::limit);
  EXPECT_EQ(give(0.0, 0.0), Outcome::limit);
  EXPECT_EQ(give(30.0, 0.0), Outcome::limit);
  EXPECT_EQ(stage_->violation().channel, 1) << "the first violation stays";
  stage_->stop();
  EXPECT_EQ(stage_->violation().kind, LimitKind::actuator);
  EXPECT_EQ(fake_->stops, 1);
  start();
  EXPECT_EQ(stage_->violation().kind, LimitKind::none);
  EXPECT_EQ(give(1.0), Outcome::ok);
}

TEST_F(LimitedStageTest, LimitsTheSlewFromSampleToSample) {
  start();
  EXPECT_EQ(give(-9.0), Outcome::limit);  // from zero at start()
  EXPECT_DOUBLE_EQ(reached()[0], -8.0);
  EXPECT_EQ(stage_->violation().kind, LimitKind::slew);
  EXPECT_DOUBLE_EQ(stage_->violation().value, -9e3);
  EXPECT_DOUBLE_EQ(stage_->violation().limit, 8e3);
  EXPECT_EQ(said(), "actuator a: slew would be 9000 N/s, limit 8000 N/s (cycle 0)");
  // The next step counts from the applied command, not from the requested one.
  give(1.0);
  EXPECT_DOUBLE_EQ(reached()[0], 0.0);
}

TEST_F(LimitedStageTest, HoldsTheThermalRmsAtItsLimit) {
  start();
  double mean_square = 0.0;
  const double decay = std::exp(-1.0 / (1e3 * 0.05));
  int first = -1;
  give(5.0);
  mean_square = (1.0 - decay) * 25.0;
  for (int n = 1; n < 1000; ++n) {
    const Outcome outcome = give(9.9);
    if (outcome == Outcome::limit && first < 0) first = n;
    mean_square = decay * mean_square + (1.0 - decay) * reached()[0] * reached()[0];
    ASSERT_LE(mean_square, 81.0 * (1.0 + 1e-12)) << n;
  }
  // 9.9^2 (1 - e^(-t/tau)) = 9^2 at t = 1.75 tau, 88 samples.
  EXPECT_NEAR(first, 88, 2);
  EXPECT_EQ(stage_->violation().kind, LimitKind::thermal_rms);
  EXPECT_DOUBLE_EQ(stage_->violation().limit, 9.0);
  EXPECT_NEAR(reached()[0], 9.0, 1e-9) << "in the long run the limit itself is what is left";
}

TEST_F(LimitedStageTest, ReplacesWhatIsNoNumberByTheLastGoodCommand) {
  start();
  EXPECT_EQ(give(3.0, 4.0), Outcome::ok);
  EXPECT_EQ(give(kNan, 5.0), Outcome::limit);
  EXPECT_THAT(reached(), testing::ElementsAre(3.0, 5.0));
  EXPECT_EQ(stage_->violation().kind, LimitKind::not_finite);
  EXPECT_EQ(said(), "actuator a: the command is not finite (cycle 1)");
  give(4.0, kInfinity);
  EXPECT_THAT(reached(), testing::ElementsAre(4.0, 5.0));
}

TEST_F(LimitedStageTest, ReportsAPositionPastItsWindow) {
  start();
  fake_->measurement = {0.0, -1.5e-3, 0.0};
  EXPECT_EQ(give(1.0), Outcome::limit);
  EXPECT_EQ(y_[1], -1.5e-3) << "the measurement itself is passed on";
  EXPECT_EQ(stage_->violation().kind, LimitKind::position);
  EXPECT_EQ(stage_->violation().channel, 1);
  EXPECT_EQ(stage_->violation().cycle, 1U);
  EXPECT_TRUE(stage_->violation().of_sensor);
  EXPECT_EQ(said(), "sensor t: |y| is 0.0015 m, limit 0.001 m (cycle 1)");
}

TEST_F(LimitedStageTest, HoldsTheLastMeasurementInPlaceOfNan) {
  start();
  fake_->measurement = {1e-4, 2e-4, 3e-4};
  EXPECT_EQ(give(0.0), Outcome::ok);
  fake_->measurement = {5e-4, 6e-4, kNan};
  EXPECT_EQ(give(7.0), Outcome::opened);
  EXPECT_THAT(y_, testing::ElementsAre(5e-4, 6e-4, 3e-4));
  EXPECT_EQ(inputs_.valid, 0b011U);
  EXPECT_EQ(stage_->violation().kind, LimitKind::not_finite);
  EXPECT_EQ(said(), "sensor u: the measurement is not finite (cycle 2)");
  EXPECT_EQ(give(7.0), Outcome::opened);
  EXPECT_THAT(reached(), testing::ElementsAre(0.0, 0.0)) << "no control on a sensor that failed";
  EXPECT_THAT(inputs_.applied, testing::ElementsAre(0.0, 0.0));
  stage_->stop();
  EXPECT_EQ(
      describe_stop(*stage_),
      "sensor u: the measurement is not finite (cycle 2); the loop was opened; not braked, 0.0055 "
      "m/s when the forces were cut");
}

TEST_F(LimitedStageTest, RefusesToStartOutsideTheWindow) {
  fake_->measurement = {0.0, 0.0, 2e-3};
  EXPECT_THROW(start(), StageError);
  EXPECT_EQ(fake_->stops, 1);
  fake_->measurement = {0.0, kNan, 0.0};
  EXPECT_THROW(start(), StageError);
}

TEST_F(LimitedStageTest, PassesOnTheOutcomeAndPastALimitWorseNewsOnly) {
  start();
  for (const Outcome outcome :
       {Outcome::late, Outcome::incomplete, Outcome::stale, Outcome::corrupt}) {
    fake_->outcome = outcome;
    EXPECT_EQ(give(0.0), outcome);
  }
  give(0.0, 30.0);
  for (const Outcome worse : {Outcome::fault, Outcome::bus_off, Outcome::link_down}) {
    fake_->outcome = worse;
    EXPECT_EQ(give(0.0), worse);
  }
  fake_->outcome = Outcome::late;
  EXPECT_EQ(give(0.0), Outcome::limit);
}

StageLimits with_stuck_sensors() {
  StageLimits limits = generous();
  limits.stuck_sensor_s = 4e-3;  // 4 samples
  return limits;
}

struct StuckSensorTest : LimitedStageTest {
  StuckSensorTest() : LimitedStageTest(with_stuck_sensors()) { start(); }
  Outcome show(double y0, double y1, double y2) {
    fake_->measurement = {y0, y1, y2};
    return give(0.0);
  }
};

TEST_F(StuckSensorTest, IsReportedAfterItsTime) {
  for (int n = 1; n <= 3; ++n) EXPECT_EQ(show(1e-5 * n, 2e-5, 1e-5 * n), Outcome::ok) << n;
  EXPECT_EQ(show(4e-5, 2e-5, 4e-5), Outcome::ok);  // four equal values: repeated three times
  EXPECT_EQ(show(5e-5, 2e-5, 5e-5), Outcome::opened);
  EXPECT_EQ(said(), "sensor t: has repeated the value 2e-05 m for 0.004 s (cycle 5)");
}

TEST_F(StuckSensorTest, AChangeBeginsAnew) {
  for (int n = 1; n <= 40; ++n)
    EXPECT_EQ(show(1e-6 * n, 2e-5 + 1e-9 * (n / 4), -1e-6 * n), Outcome::ok) << n;
}

TEST_F(StuckSensorTest, StandsAtZeroToo) {
  for (int n = 1; n <= 3; ++n) EXPECT_EQ(show(1e-5 * n, 1e-5 * n, 0.0), Outcome::ok) << n;
  EXPECT_EQ(show(4e-5, 4e-5, 0.0), Outcome::opened);  // the first value of the run was zero
}

TEST_F(LimitedStageTest, ASensorMayStandStillIfNobodySaysHowLong) {
  start();
  fake_->measurement = {1e-5, 1e-5, 1e-5};
  for (int n = 0; n < 1000; ++n) ASSERT_EQ(give(0.0), Outcome::ok);
}

struct UnlimitedStageTest : LimitedStageTest {
  UnlimitedStageTest() : LimitedStageTest(StageLimits{}) {}
};

TEST_F(UnlimitedStageTest, RefusesNothingButWhatIsNoNumber) {
  fake_->measurement = {1e9, 0.0, 0.0};
  start();
  EXPECT_EQ(give(1e9, -1e9), Outcome::ok);
  EXPECT_THAT(reached(), testing::ElementsAre(1e9, -1e9));
  EXPECT_EQ(give(0.0, kNan), Outcome::limit);
  EXPECT_THAT(reached(), testing::ElementsAre(0.0, -1e9));
  fake_->measurement = {kInfinity, 0.0, 0.0};
  give(0.0);
  EXPECT_EQ(y_[0], 1e9);
}

TEST(LimitedStage, RefusesLimitsThatDoNotFit) {
  const auto make = [](void (*change)(StageLimits&)) {
    StageLimits limits = generous();
    change(limits);
    return LimitedStage(std::make_unique<test::FakeStage>(2, 3, 1e3), limits);
  };
  EXPECT_NO_THROW(make([](StageLimits&) {}));
  const auto refused = [&](void (*change)(StageLimits&)) {
    EXPECT_THROW(make(change), std::invalid_argument);
  };
  refused([](StageLimits& l) { l.actuator_n.resize(3); });
  refused([](StageLimits& l) { l.actuator_n[1] = 0.0; });
  refused([](StageLimits& l) { l.slew_n_s[0] = -1.0; });
  refused([](StageLimits& l) { l.thermal_rms_n[0] = kNan; });
  refused([](StageLimits& l) { l.position_window_m.resize(2); });
  refused([](StageLimits& l) { l.thermal_time_constant_s = 0.0; });
  refused([](StageLimits& l) { l.hard_window_m = Eigen::Vector3d(1e-3, 1e-3, 9e-4); });
  refused([](StageLimits& l) { l.speed_m_s.setOnes(1); });
  refused([](StageLimits& l) { l.motion.acceleration_per_n.setOnes(2, 2); });
  refused([](StageLimits& l) { l.stuck_sensor_s = -1.0; });
  refused([](StageLimits& l) { l.stuck_sensor_s = kNan; });
  refused([](StageLimits& l) { l.stuck_sensor_s = 1e-3; });
  EXPECT_THROW(LimitedStage(nullptr, generous()), std::invalid_argument);
  EXPECT_THROW(LimitedStage(std::make_unique<test::FakeStage>(2, 3, 0.0), generous()),
               std::invalid_argument);
}

TEST(LimitedStage, SaysThatNoLimitWasExceeded) {
  EXPECT_EQ(describe({}, {}), "no limit was exceeded");
}

}  // namespace stageid::test_limited_stage
