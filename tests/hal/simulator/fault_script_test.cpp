#include "hal/simulator/fault_script.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include "tests/hal/stage_bench.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_fault_script {

using Kind = SimulationSpec::Fault::Kind;
using test::Bench;

test::SimulatedSpec with_fault(Kind kind, int channel, std::uint64_t from, std::uint64_t cycles = 1,
                               int run = -1) {
  test::SimulatedSpec spec = test::small_stage_spec();
  spec.info.sensors.push_back(spec.info.sensors[0]);
  spec.info.sensors[1].position_m[0] = -0.5;
  if (kind != Kind::none) spec.simulation.faults = {{kind, channel, from, cycles, run}};
  return spec;
}

// Runs a faulty stage beside a healthy one with the same commands.
struct FaultTest : testing::Test {
  void begin(const test::SimulatedSpec& spec) {
    faulty_ = std::make_unique<Bench>(spec);
    healthy_ = std::make_unique<Bench>(with_fault(Kind::none, 0, 0));
    faulty_->start();
    healthy_->start();
  }
  using Command = std::vector<double>;
  Outcome step(const Command& faulty, const Command& healthy) {
    faulty_->u = faulty;
    healthy_->u = healthy;
    EXPECT_EQ(healthy_->step(), Outcome::ok);
    return faulty_->step();
  }
  Outcome step(double u0, double u1) { return step(Command{u0, u1}, Command{u0, u1}); }
  std::unique_ptr<Bench> faulty_;
  std::unique_ptr<Bench> healthy_;
};

// A stuck sensor claims to be well.
TEST_F(FaultTest, ADeadOrStuckSensorIsHeld) {
  for (const Kind kind : {Kind::dead_sensor, Kind::stuck_sensor}) {
    begin(with_fault(kind, 1, 3));
    double held = 0.0;
    for (int n = 0; n < 6; ++n) {
      const bool missing = kind == Kind::dead_sensor && n >= 3;
      EXPECT_EQ(step(1.0, -1.0), missing ? Outcome::incomplete : Outcome::ok);
      if (n == 2) held = faulty_->y[1];
      EXPECT_EQ(faulty_->inputs.valid, missing ? 0b01U : 0b11U);
      EXPECT_EQ(faulty_->y[0], healthy_->y[0]);
      EXPECT_EQ(faulty_->y[1], n < 3 ? healthy_->y[1] : held);
    }
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

TEST_F(FaultTest, MissedCyclesHoldCommandAndMeasurement) {
  begin(with_fault(Kind::missed_cycle, 0, 2, 2));
  std::vector<double> held;
  for (int n = 0; n < 8; ++n) {
    const bool missed = n == 2 || n == 3;
    if (n == 2) held = faulty_->y;
    // The healthy stage is given the last command that arrived.
    EXPECT_EQ(step({1.0 + n, 0.0}, {missed ? 2.0 : 1.0 + n, 0.0}),
              missed ? Outcome::stale : Outcome::ok);
    EXPECT_EQ(faulty_->inputs.cycle, static_cast<std::uint64_t>(n + 1));
    EXPECT_EQ(faulty_->inputs.valid, missed ? 0U : 0b11U);
    EXPECT_EQ(faulty_->y, missed ? held : healthy_->y) << n;
  }
}

TEST_F(FaultTest, AnInterlockTakesTheForcesAway) {
  begin(with_fault(Kind::interlock, 0, 3));
  for (int n = 0; n < 8; ++n) {
    EXPECT_EQ(step({1.0, 2.0}, n < 3 ? Command{1.0, 2.0} : Command{0.0, 0.0}),
              n < 3 ? Outcome::ok : Outcome::fault);
    EXPECT_EQ(faulty_->inputs.node_state, n < 3 ? NodeState::operation_enabled : NodeState::fault);
    EXPECT_EQ(faulty_->y, healthy_->y);
  }
}

TEST_F(FaultTest, AStuckActuatorKeepsItsLastForce) {
  begin(with_fault(Kind::stuck_actuator, 1, 4));
  for (int n = 0; n < 10; ++n) {
    EXPECT_EQ(step({0.5, 1.0 + n}, {0.5, n < 4 ? 1.0 + n : 4.0}), Outcome::ok);
    EXPECT_EQ(faulty_->y, healthy_->y) << n;
  }
}

test::SimulatedSpec with_value(Kind kind, int channel, std::uint64_t from, double value) {
  test::SimulatedSpec spec = with_fault(kind, channel, from);
  spec.simulation.faults[0].value = value;
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
    const double gain = n < 4 ? 1.0 : -1.0;
    EXPECT_EQ(step({0.5, 1.0 + n}, {gain * 0.5, gain * (1.0 + n)}), Outcome::ok);
    EXPECT_EQ(faulty_->y, healthy_->y);
  }
}

// Full at the 4th sample after cycle 2: y[2] is the last without the fault.
TEST_F(FaultTest, ASensorGainGrows) {
  test::SimulatedSpec spec = with_value(Kind::sensor_gain, 1, 2, 0.6);
  spec.simulation.faults[0].ramp_s = 4.0 / spec.info.sample_rate_hz;
  begin(spec);
  for (int n = 0; n < 10; ++n) {
    EXPECT_EQ(step(1.0, -1.0), Outcome::ok);
    EXPECT_EQ(faulty_->y[0], healthy_->y[0]);
    const double gain = 1.0 - 0.4 * std::clamp((n - 1) / 4.0, 0.0, 1.0);
    EXPECT_DOUBLE_EQ(faulty_->y[1], gain * healthy_->y[1]) << n;
  }
}

TEST_F(FaultTest, AnActuatorGainGrows) {
  test::SimulatedSpec spec = with_value(Kind::actuator_gain, 1, 2, 0.6);
  spec.simulation.faults[0].ramp_s = 4.0 / spec.info.sample_rate_hz;
  begin(spec);
  for (int n = 0; n < 10; ++n) {
    const double gain = 1.0 - 0.4 * std::clamp((n - 1.5) / 4.0, 0.0, 1.0);
    EXPECT_EQ(step({0.5, 1.0 + n}, {0.5, gain * (1.0 + n)}), Outcome::ok);
    for (std::size_t i : {0U, 1U})
      EXPECT_NEAR(faulty_->y[i], healthy_->y[i], 1e-14 * std::abs(healthy_->y[i])) << n;
  }
}

// White and coloured noise, of one sensor and of all: the same numbers, three times as large.
TEST(SensorNoise, IsMultiplied) {
  for (const int channel : {1, -1}) {
    test::SimulatedSpec spec = with_value(Kind::sensor_noise, channel, 5, 3.0);
    spec.simulation.sensor_noise_m = 1e-3;
    spec.simulation.sensor_noise_coloured_m = 2e-3;
    Bench loud(spec);
    spec.simulation.faults.clear();
    Bench usual(spec);
    loud.start();
    usual.start();
    for (int n = 0; n < 20; ++n) {
      EXPECT_EQ(loud.step(), Outcome::ok);
      EXPECT_EQ(usual.step(), Outcome::ok);
      for (int i : {0, 1}) {
        const double factor = n >= 5 && (channel == -1 || channel == i) ? 3.0 : 1.0;
        EXPECT_DOUBLE_EQ(loud.y[i], factor * usual.y[i]) << n;
      }
    }
  }
}

void refuses_fault(
    const SimulationSpec::Fault& fault, const std::string& text,
    const std::function<void(PlantSpec&)>& change = [](PlantSpec&) {}) {
  test::SimulatedSpec spec = with_fault(Kind::none, 0, 0);
  spec.simulation.faults = {fault};
  change(spec.plant);
  EXPECT_THAT([&] { test::simulated(spec); }, test::refuses<std::invalid_argument>(text));
}

TEST(Faults, ThatCannotBe) {
  const auto of = [](Kind kind, int channel, double value, double ramp_s = 0.0) {
    return SimulationSpec::Fault{kind, channel, 0, 1, -1, value, ramp_s};
  };
  refuses_fault(of(Kind::mode_frequency, 7, 0.1), "mode 7 is out of range; allowed: 0 to 6");
  refuses_fault(of(Kind::mode_frequency, -2, 0.1), "mode -2 is out of range");
  refuses_fault(of(Kind::mode_frequency, 6, -1.0), "frequency of mode 6 would be 0 Hz");
  refuses_fault(of(Kind::mode_frequency, 2, 0.1), "frequency of mode 2 would be 0 Hz",
                [](PlantSpec& plant) { plant.suspension_hz[2] = 0.0; });
  refuses_fault(of(Kind::mode_frequency, -1, 0.1), "no flexible mode",
                [](PlantSpec& plant) { plant.flexible_modes = 0; });
  refuses_fault(of(Kind::mode_damping, 6, -1.5), "damping ratio of mode 6 would be -0.01");
  refuses_fault(of(Kind::mode_damping, -1, 49.0), "damping ratio of mode 6 would be 1;");
  refuses_fault(of(Kind::sensor_gain, 2, 1.1), "channel 2 is out of range; there are 2 sensors");
  refuses_fault(of(Kind::sensor_noise, -1, -1.0), "sensor_noise is -1");
  refuses_fault(of(Kind::sensor_gain, -1, 1.1, -1.0), "ramp_s is -1");
  refuses_fault(of(Kind::sensor_drift, -1, 1.0, 1.0), "sensor_drift cannot be gradual");
  refuses_fault(of(Kind::dead_sensor, 0, 0.0, 1.0), "dead_sensor cannot be gradual");
}

TEST(Faults, ThatCannotBeTogether) {
  test::SimulatedSpec spec = with_fault(Kind::none, 0, 0);
  const auto of = [](int run) {  // of a damping ratio of 0.02
    return SimulationSpec::Fault{Kind::mode_damping, 6, 0, 1, run, 9.0};
  };
  spec.simulation.faults = {of(0), of(1)};
  EXPECT_NO_THROW(test::simulated(spec));
  spec.simulation.faults = {of(-1), of(1)};
  EXPECT_THAT([&] { test::simulated(spec); },
              test::refuses<std::invalid_argument>("together raise the damping ratio of mode 6"));
}

// One sample more after every second cycle.
TEST_F(FaultTest, AnExtraDelayGrowsInWholeSamples) {
  test::SimulatedSpec spec = with_value(Kind::extra_delay, -1, 4, 2.0);
  spec.simulation.faults[0].ramp_s = 4.0 / spec.info.sample_rate_hz;
  begin(spec);
  for (int n = 0; n < 12; ++n) {
    const int samples = n < 6 ? 0 : n < 8 ? 1 : 2;
    EXPECT_EQ(step({1.0 + n, -1.0}, {1.0 + n - samples, -1.0}), Outcome::ok);
    EXPECT_EQ(faulty_->y, healthy_->y) << n;
  }
}

TEST_F(FaultTest, ForcesComeSamplesLater) {
  begin(with_value(Kind::extra_delay, -1, 5, 3.0));
  for (int n = 0; n < 12; ++n) {
    EXPECT_EQ(step({1.0 + n, -1.0}, {n < 5 ? 1.0 + n : n - 2.0, -1.0}), Outcome::ok);
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

}  // namespace stageid::test_fault_script
