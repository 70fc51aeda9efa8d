#include "hal/simulator/simulated_stage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <functional>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "hal/simulator/modal_plant.hpp"
#include "tests/hal/simulator/closed_loop.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_simulated_stage {

using Kind = SimulationSpec::Fault::Kind;

using test::Bench;
using test::SimulatedSpec;

std::vector<double> closed_loop_record(SimulatedStage& stage, const SimulatedSpec& spec,
                                       std::uint64_t run_seed, int samples) {
  test::ClosedLoop loop(stage, spec.controller);
  loop.start(run_seed);
  std::vector<double> record;
  Eigen::VectorXd r = Eigen::VectorXd::Zero(17);
  for (int n = 0; n < samples; ++n) {
    r[n % 13] = std::sin(0.1 * n);
    EXPECT_EQ(loop.step(r), Outcome::ok);
    record.insert(record.end(), loop.y().begin(), loop.y().end());
    record.insert(record.end(), loop.u().begin(), loop.u().end());
  }
  return record;
}

TEST(SimulatedStage, RepeatsARunExactlyWhateverWasRunBefore) {
  const SimulatedSpec spec = test::wafer_stage_spec();
  SimulatedStage stage(spec.info, spec.plant, spec.simulation);
  const auto first = closed_loop_record(stage, spec, 7, 500);
  const auto other = closed_loop_record(stage, spec, 8, 300);
  const auto again = closed_loop_record(stage, spec, 7, 500);
  EXPECT_EQ(first, again);
  EXPECT_NE(first, other);
  SimulatedStage another(spec.info, spec.plant, spec.simulation);
  EXPECT_EQ(closed_loop_record(another, spec, 7, 500), first);
  SimulatedSpec reseeded = spec;
  reseeded.simulation.seed = 2;
  SimulatedStage third(spec.info, spec.plant, reseeded.simulation);
  EXPECT_NE(closed_loop_record(third, spec, 7, 500), first);
}

TEST(SimulatedStage, TellsWhatItIs) {
  SimulatedSpec spec = test::small_stage_spec();
  spec.info.delay_s = 1.5e-3;
  spec.info.backend.clear();
  const SimulatedStage stage(spec.info, spec.plant, spec.simulation);
  EXPECT_EQ(stage.info().backend, "sim");
  EXPECT_EQ(stage.info().delay_s, 1.5e-3);
  EXPECT_EQ(stage.info().maximum_rate_hz, 1e3);
  EXPECT_EQ(stage.info().clock, Clock::virtual_time);
  EXPECT_EQ(plant_modes(spec.info, spec.plant).size(), 7U);
  spec.pace = 1.0;
  EXPECT_EQ(test::simulated(spec)->info().clock, Clock::wall);
}

TEST(SimulatedStage, KeepsVirtualTimeByCountingSamples) {
  Bench bench(test::small_stage_spec());
  bench.start();
  EXPECT_EQ(bench.inputs.t_sample_ns, 0);
  for (std::uint64_t n = 1; n <= 5; ++n) {
    EXPECT_EQ(bench.step(), Outcome::ok);
    EXPECT_EQ(bench.inputs.cycle, n);
    EXPECT_EQ(bench.inputs.t_sample_ns, static_cast<std::int64_t>(n) * 1'000'000);
    EXPECT_EQ(bench.inputs.t_rx_ns, bench.inputs.t_sample_ns);
    EXPECT_EQ(bench.inputs.node_state, NodeState::operation_enabled);
  }
  EXPECT_EQ(bench.step({6'000'000}), Outcome::ok);
  EXPECT_EQ(bench.step({6'999'999}), Outcome::late);
}

TEST(SimulatedStage, AnswersNothingUnlessStarted) {
  Bench bench(test::small_stage_spec());
  EXPECT_EQ(bench.step(), Outcome::fault);
  EXPECT_EQ(bench.inputs.valid, 0U);
  bench.start();
  EXPECT_EQ(bench.step(), Outcome::ok);
  bench.stage().stop();
  bench.stage().stop();
  EXPECT_EQ(bench.step(), Outcome::fault);
}

TEST(SimulatedStage, RefusesACommandThatIsNoNumberAndKeepsTheLast) {
  const SimulatedSpec spec = test::small_stage_spec();
  Bench bench(spec);
  Bench steady(spec);
  bench.start();
  steady.start();
  for (int n = 0; n < 5; ++n) {
    bench.u = {1.0, 2.0};
    steady.u = {1.0, 2.0};
    if (n == 3) bench.u[1] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(bench.step(), n == 3 ? Outcome::fault : Outcome::ok);
    EXPECT_EQ(steady.step(), Outcome::ok);
    EXPECT_EQ(bench.y, steady.y);
  }
}

TEST(SimulatedStage, SaturatesAndQuantizesTheForces) {
  SimulatedSpec spec = test::small_stage_spec();
  Bench plain(spec);
  spec.plant.actuator_saturation_n = 2.0;
  spec.simulation.actuator_quantum_n = 0.5;
  Bench limited(spec);
  plain.start();
  limited.start();
  const double given[] = {0.3, 1.2, 7.0, -9.0, -0.2};
  const double taken[] = {0.5, 1.0, 2.0, -2.0, 0.0};
  for (int n = 0; n < 5; ++n) {
    limited.u[0] = given[n];
    plain.u[0] = taken[n];
    EXPECT_EQ(limited.step(), Outcome::ok);
    EXPECT_EQ(plain.step(), Outcome::ok);
    EXPECT_EQ(limited.y, plain.y) << n;
  }
}

TEST(SimulatedStage, QuantizesTheMeasurement) {
  SimulatedSpec spec = test::small_stage_spec();
  Bench plain(spec);
  spec.simulation.sensor_quantum_m = 1e-7;
  Bench coarse(spec);
  plain.start();
  coarse.start();
  double largest = 0.0;
  for (int n = 0; n < 200; ++n) {
    plain.u[0] = coarse.u[0] = std::sin(0.2 * n);
    EXPECT_EQ(plain.step(), Outcome::ok);
    EXPECT_EQ(coarse.step(), Outcome::ok);
    const double counts = coarse.y[0] / 1e-7;
    EXPECT_NEAR(counts, std::round(counts), 1e-9);
    largest = std::max(largest, std::abs(coarse.y[0] - plain.y[0]));
  }
  EXPECT_LE(largest, 0.5e-7 * (1.0 + 1e-9));
  EXPECT_GT(largest, 0.4e-7);
}

// A mass on a cubic spring under a constant force comes to rest (because of the suspension's damper) at
// k z + c z^3 = F.
TEST(SimulatedStage, SettlesWhereTheCubicSpringHoldsTheForce) {
  SimulatedSpec spec = test::small_stage_spec();
  spec.info.actuators[0].position_m[0] = spec.info.actuators[0].position_m[1] = 0.0;
  spec.info.sensors[0].position_m[0] = spec.info.sensors[0].position_m[1] = 0.0;
  spec.plant.flexible_modes = 0;
  spec.plant.suspension_damping = 0.5;
  spec.plant.cubic_stiffness_n_m3 = 1e5;
  Bench bench(spec);
  bench.start();
  bench.u[0] = 10.0;
  for (int n = 0; n < 20000; ++n) EXPECT_EQ(bench.step(), Outcome::ok);
  const double stiffness =
      spec.plant.mass_kg * std::pow(2.0 * std::numbers::pi * spec.plant.suspension_hz[2], 2);
  const double z = bench.y[0];
  EXPECT_NEAR(stiffness * z + 1e5 * z * z * z, 10.0, 1e-6);
  EXPECT_GT(1e5 * z * z * z, 1.0) << "the cubic part must matter";
}

TEST(SimulatedStage, StartsFromStandstillWithSensorNoiseOnly) {
  Bench bench(test::wafer_stage_spec());
  bench.start(3);
  for (const double y : bench.y) {
    EXPECT_NE(y, 0.0);
    EXPECT_LT(std::abs(y), 6.0 * std::hypot(0.3e-9, 0.5e-9));
  }
  EXPECT_EQ(bench.inputs.valid, 0x7fU);
}

TEST(SimulatedStage, AgainstTheWallClockIsLateOnlyWhenCalledTooLate) {
  SimulatedSpec spec = test::small_stage_spec();
  spec.pace = 1.0;
  Bench bench(spec);
  bench.start();
  const std::int64_t origin = bench.inputs.t_sample_ns;
  int late = 0;
  for (int n = 1; n <= 20; ++n) {
    late += bench.step() == Outcome::late ? 1 : 0;
    EXPECT_GE(bench.inputs.t_rx_ns, bench.inputs.t_sample_ns);
    // On the grid of 1 ms, with or without skipped periods.
    EXPECT_EQ((bench.inputs.t_sample_ns - origin) % 1'000'000, 0);
  }
  EXPECT_LT(late, 20);
  const std::int64_t before = bench.inputs.t_sample_ns;
  const timespec pause{0, 5'500'000};
  nanosleep(&pause, nullptr);
  EXPECT_EQ(bench.step(), Outcome::late);
  EXPECT_EQ(bench.step({1}), Outcome::late) << "past its deadline";
  EXPECT_GE(bench.inputs.t_sample_ns - before, 5'000'000) << "the missed periods are skipped";
}

TEST(SimulatedStage, RefusesABadSpecNamingTheField) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refuse = [](const char* field, const std::function<void(SimulatedSpec&)>& change) {
    SimulatedSpec spec = test::small_stage_spec();
    change(spec);
    EXPECT_THAT([&] { test::simulated(spec); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr(field)));
  };
  refuse("sample_rate_hz", [](SimulatedSpec& s) { s.info.sample_rate_hz = 0.0; });
  refuse("mass_kg", [](SimulatedSpec& s) { s.plant.mass_kg = -1.0; });
  refuse("inertia_kg_m2", [](SimulatedSpec& s) { s.plant.inertia_kg_m2[1] = 0.0; });
  refuse("suspension_hz", [](SimulatedSpec& s) { s.plant.suspension_hz[5] = -0.1; });
  refuse("suspension_damping", [](SimulatedSpec& s) { s.plant.suspension_damping = 1.0; });
  refuse("length_x_m", [](SimulatedSpec& s) { s.plant.length_x_m = 0.0; });
  refuse("length_y_m", [&](SimulatedSpec& s) { s.plant.length_y_m = nan; });
  refuse("poisson_ratio", [](SimulatedSpec& s) { s.plant.poisson_ratio = 0.5; });
  refuse("first_mode_hz", [](SimulatedSpec& s) { s.plant.first_mode_hz = 0.0; });
  refuse("modes", [](SimulatedSpec& s) { s.plant.flexible_modes = 1000; });
  refuse("damping", [](SimulatedSpec& s) { s.plant.flexible_damping.clear(); });
  refuse("damping", [](SimulatedSpec& s) { s.plant.flexible_damping = {-0.1}; });
  refuse("in_plane_modes", [](SimulatedSpec& s) {
    s.plant.in_plane_modes = {{10.0, 0.1, Eigen::VectorXd::Ones(2), Eigen::VectorXd::Ones(2)}};
  });
  refuse("delay_s", [](SimulatedSpec& s) { s.info.delay_s = -1e-6; });
  refuse("delay", [](SimulatedSpec& s) { s.info.delay_s = 1e6; });
  refuse("sensor_m", [](SimulatedSpec& s) { s.simulation.sensor_noise_m = -1.0; });
  refuse("sensor_coloured_m",
         [&](SimulatedSpec& s) { s.simulation.sensor_noise_coloured_m = nan; });
  refuse("sensor_corner_hz", [](SimulatedSpec& s) { s.simulation.sensor_noise_corner_hz = 0.0; });
  refuse("force_n", [](SimulatedSpec& s) { s.simulation.force_noise_n = -1.0; });
  refuse("sensor_quantum_m", [](SimulatedSpec& s) { s.simulation.sensor_quantum_m = -1.0; });
  refuse("actuator_quantum_n", [](SimulatedSpec& s) { s.simulation.actuator_quantum_n = -1.0; });
  refuse("cubic_stiffness_n_m3", [](SimulatedSpec& s) { s.plant.cubic_stiffness_n_m3 = -1.0; });
  refuse("actuator_saturation_n", [](SimulatedSpec& s) { s.plant.actuator_saturation_n = -1.0; });
  refuse("pace", [](SimulatedSpec& s) { s.pace = -1.0; });
  refuse("actuators", [](SimulatedSpec& s) { s.info.actuators.clear(); });
  refuse("sensors", [](SimulatedSpec& s) { s.info.sensors.resize(65, s.info.sensors[0]); });
  refuse("direction", [](SimulatedSpec& s) { s.info.sensors[0].direction[2] = 0.5; });
  refuse("position_m", [](SimulatedSpec& s) { s.info.actuators[0].position_m[0] = 0.6; });
  for (const SimulationSpec::Fault& fault : {SimulationSpec::Fault{Kind::dead_sensor, 1, 0, 1, -1},
                                             {Kind::stuck_actuator, -1, 0, 1, -1},
                                             {Kind::missed_cycle, 0, 0, 0, -1},
                                             {Kind::extra_delay, -1, 0, 1, -1, 0.5}})
    refuse("faults", [&](SimulatedSpec& s) { s.simulation.faults = {fault}; });
}

TEST(SimulatedStage, WantsRoomForEverySensor) {
  const auto stage = test::simulated(test::small_stage_spec());
  std::vector<double> y(3);
  Inputs inputs;
  inputs.y = y;
  EXPECT_THROW(stage->start(0, inputs), std::invalid_argument);
}

}  // namespace stageid::test_simulated_stage
