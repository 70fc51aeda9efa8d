#include "hal/simulator/fault_script.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "tests/hal/stage_bench.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid {
namespace test_fault_script {

using Kind = WaferStageSpec::Fault::Kind;
using test::Bench;

WaferStageSpec with_fault(Kind kind, int channel, std::uint64_t from, std::uint64_t cycles = 1,
                          int run = -1) {
  WaferStageSpec spec = test::small_stage_spec();
  spec.info.sensors.push_back(spec.info.sensors[0]);
  spec.info.sensors[1].position_m[0] = -0.5;
  if (kind != Kind::none) spec.faults = {{kind, channel, from, cycles, run}};
  return spec;
}

// Runs a faulty stage beside a healthy one with the same commands.
class FaultTest : public testing::Test {
 protected:
  void begin(const WaferStageSpec& spec) {
    faulty_ = std::make_unique<Bench>(spec);
    healthy_ = std::make_unique<Bench>(with_fault(Kind::none, 0, 0));
    faulty_->start();
    healthy_->start();
  }
  Outcome step(double u0, double u1) {
    faulty_->u = {u0, u1};
    healthy_->u = {u0, u1};
    EXPECT_EQ(healthy_->step(), Outcome::ok);
    return faulty_->step();
  }
  std::unique_ptr<Bench> faulty_;
  std::unique_ptr<Bench> healthy_;
};

TEST_F(FaultTest, ADeadSensorIsMissingAndHeld) {
  begin(with_fault(Kind::dead_sensor, 1, 3));
  double held = 0.0;
  for (int n = 0; n < 6; ++n) {
    const Outcome outcome = step(1.0, -1.0);
    if (n == 2) held = faulty_->y[1];
    EXPECT_EQ(outcome, n < 3 ? Outcome::ok : Outcome::incomplete);
    EXPECT_EQ(faulty_->inputs.valid, n < 3 ? 0b11U : 0b01U);
    EXPECT_EQ(faulty_->y[0], healthy_->y[0]);
    EXPECT_EQ(faulty_->y[1], n < 3 ? healthy_->y[1] : held);
  }
}

TEST_F(FaultTest, ANanSensorClaimsToBeWell) {
  begin(with_fault(Kind::nan_sensor, 0, 2));
  for (int n = 0; n < 4; ++n) {
    EXPECT_EQ(step(1.0, 0.0), Outcome::ok);
    EXPECT_EQ(std::isnan(faulty_->y[0]), n >= 2);
    EXPECT_EQ(faulty_->y[1], healthy_->y[1]);
    EXPECT_EQ(faulty_->inputs.valid, 0b11U);
  }
}

TEST_F(FaultTest, AStuckSensorShowsItsLastValueAndClaimsToBeWell) {
  begin(with_fault(Kind::stuck_sensor, 1, 3));
  double held = 0.0;
  for (int n = 0; n < 6; ++n) {
    EXPECT_EQ(step(1.0, -1.0), Outcome::ok);
    if (n == 2) held = faulty_->y[1];
    EXPECT_EQ(faulty_->inputs.valid, 0b11U);
    EXPECT_EQ(faulty_->y[0], healthy_->y[0]);
    EXPECT_EQ(faulty_->y[1], n < 3 ? healthy_->y[1] : held);
  }
}

TEST_F(FaultTest, MissedCyclesHoldCommandAndMeasurement) {
  begin(with_fault(Kind::missed_cycle, 0, 2, 2));
  std::vector<double> held;
  for (int n = 0; n < 8; ++n) {
    faulty_->u = {1.0 + n, 0.0};
    healthy_->u = {n == 2 || n == 3 ? 2.0 : 1.0 + n, 0.0};  // the last command that arrived
    EXPECT_EQ(healthy_->step(), Outcome::ok);
    const bool missed = n == 2 || n == 3;
    if (n == 2) held = faulty_->y;
    EXPECT_EQ(faulty_->step(), missed ? Outcome::stale : Outcome::ok);
    EXPECT_EQ(faulty_->inputs.cycle, static_cast<std::uint64_t>(n + 1));
    EXPECT_EQ(faulty_->inputs.valid, missed ? 0U : 0b11U);
    EXPECT_EQ(faulty_->y, missed ? held : healthy_->y) << n;
  }
}

TEST_F(FaultTest, AnInterlockTakesTheForcesAway) {
  begin(with_fault(Kind::interlock, 0, 3));
  for (int n = 0; n < 8; ++n) {
    faulty_->u = {1.0, 2.0};
    healthy_->u = n < 3 ? std::vector<double>{1.0, 2.0} : std::vector<double>{0.0, 0.0};
    EXPECT_EQ(healthy_->step(), Outcome::ok);
    EXPECT_EQ(faulty_->step(), n < 3 ? Outcome::ok : Outcome::fault);
    EXPECT_EQ(faulty_->inputs.node_state, n < 3 ? NodeState::operation_enabled : NodeState::fault);
    EXPECT_EQ(faulty_->y, healthy_->y);
  }
}

TEST_F(FaultTest, AStuckActuatorKeepsItsLastForce) {
  begin(with_fault(Kind::stuck_actuator, 1, 4));
  for (int n = 0; n < 10; ++n) {
    faulty_->u = {0.5, 1.0 + n};
    healthy_->u = {0.5, n < 4 ? 1.0 + n : 4.0};
    EXPECT_EQ(healthy_->step(), Outcome::ok);
    EXPECT_EQ(faulty_->step(), Outcome::ok);
    EXPECT_EQ(faulty_->y, healthy_->y) << n;
  }
}

WaferStageSpec with_value(Kind kind, int channel, std::uint64_t from, double value) {
  WaferStageSpec spec = with_fault(kind, channel, from);
  spec.faults[0].value = value;
  return spec;
}

TEST_F(FaultTest, ASensorJumpsAndClaimsToBeWell) {
  begin(with_value(Kind::sensor_offset, 1, 3, 1e-4));
  for (int n = 0; n < 6; ++n) {
    EXPECT_EQ(step(1.0, -1.0), Outcome::ok);
    EXPECT_EQ(faulty_->y[0], healthy_->y[0]);
    EXPECT_DOUBLE_EQ(faulty_->y[1], healthy_->y[1] + (n < 3 ? 0.0 : 1e-4));
  }
}

TEST_F(FaultTest, AllSensorsDrift) {
  begin(with_value(Kind::sensor_drift, -1, 2, 1e-3));
  const double period_s = 1.0 / with_fault(Kind::none, 0, 0).info.sample_rate_hz;
  for (int n = 0; n < 6; ++n) {
    EXPECT_EQ(step(1.0, -1.0), Outcome::ok);
    for (std::size_t i : {0U, 1U})
      EXPECT_NEAR(faulty_->y[i] - healthy_->y[i], std::max(0, n - 1) * period_s * 1e-3, 1e-15);
  }
}

TEST_F(FaultTest, ActuatorsGiveAMultipleOfTheirForce) {
  begin(with_value(Kind::actuator_gain, -1, 4, -1.0));
  for (int n = 0; n < 10; ++n) {
    faulty_->u = {0.5, 1.0 + n};
    healthy_->u = n < 4 ? std::vector<double>{0.5, 1.0 + n} : std::vector<double>{-0.5, -1.0 - n};
    EXPECT_EQ(healthy_->step(), Outcome::ok);
    EXPECT_EQ(faulty_->step(), Outcome::ok);
    EXPECT_EQ(faulty_->y, healthy_->y);
  }
}

TEST_F(FaultTest, ForcesComeSamplesLater) {
  begin(with_value(Kind::extra_delay, -1, 5, 3.0));
  for (int n = 0; n < 12; ++n) {
    faulty_->u = {1.0 + n, -1.0};
    healthy_->u = {n < 5 ? 1.0 + n : n - 2.0, -1.0};
    EXPECT_EQ(healthy_->step(), Outcome::ok);
    EXPECT_EQ(faulty_->step(), Outcome::ok);
    EXPECT_EQ(faulty_->y, healthy_->y) << n;
  }
}

TEST_F(FaultTest, ComesInTheAskedRunOnly) {
  begin(with_fault(Kind::interlock, 0, 0, 1, 1));
  EXPECT_EQ(step(0.0, 0.0), Outcome::ok);
  faulty_->start();
  EXPECT_EQ(step(0.0, 0.0), Outcome::fault);
  faulty_->start();
  EXPECT_EQ(step(0.0, 0.0), Outcome::ok);
}

// Counts and policies only: wall-clock figures are for benchmarks.

}  // namespace test_fault_script
}  // namespace stageid
