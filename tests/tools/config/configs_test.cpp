// Every shipped configuration loads and has the documented properties.
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/input_files.hpp"
#include "hal/can/can_dbc.hpp"
#include "tests/support/stages/wafer_stage.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/experiment/link_load.hpp"
#include "tools/fleet/fleet_config.hpp"

namespace stageid::test_configs {

const std::filesystem::path kConfigs = std::filesystem::path(STAGEID_SOURCE_DIR) / "configs";

/// Loads every file in this folder.
void expect_loads(const char* folder, int least,
                  const std::function<void(const std::filesystem::path&)>& load) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kConfigs / folder)) {
    SCOPED_TRACE(entry.path());
    EXPECT_NO_THROW(load(entry.path()));
    ++count;
  }
  EXPECT_GE(count, least);
}

TEST(Configs, EveryFileLoads) {
  expect_loads("stage", 2, [](const auto& file) { load_stage_config(file); });
  expect_loads("experiment", 3, [](const auto& file) {
    EXPECT_GT(outline_plan(load_experiment_config(file)).runs().size(), 0U);
  });
  expect_loads("fleet", 1,
               [](const auto& file) { EXPECT_FALSE(load_fleet_config(file).logs.empty()); });
}

TEST(Configs, WhatTheWiresHaveToCarryIsForetold) {
  StageConfig can = load_stage_config(kConfigs / "stage/small_stage_can.yaml");
  can.can.mode = CanMode::streaming;
  const std::vector<LinkLoad> buses = link_loads(can);
  ASSERT_FALSE(buses.empty());
  for (const LinkLoad& bus : buses) {
    // states in addition to the cycle
    EXPECT_GE(bus.load, bus.cycle_s * can.spec.info.sample_rate_hz);
    EXPECT_LT(bus.load, 0.8);
    EXPECT_GT(bus.most_hz, can.spec.info.sample_rate_hz);
  }
  can.can.mode = CanMode::resident;
  EXPECT_TRUE(link_loads(can).empty());

  const StageConfig modbus = load_stage_config(kConfigs / "stage/small_stage_modbus.yaml");
  const std::vector<LinkLoad> links = link_loads(modbus);
  ASSERT_EQ(links.size(), 1U);
  EXPECT_DOUBLE_EQ(links[0].load, links[0].cycle_s * modbus.spec.info.sample_rate_hz);
  EXPECT_LE(links[0].load, 1.0);
  EXPECT_TRUE(link_loads(load_stage_config(kConfigs / "stage/small_stage.yaml")).empty());
}

TEST(Configs, AFaultIsReadWithItsChannelOrMode) {
  using Kind = SimulationSpec::Fault::Kind;
  const std::filesystem::path file = kConfigs / "stage/small_stage.yaml";
  const auto faults =
      parse_stage_config(
          file,
          load_stage_config(file).text +
              "\nfaults:\n"
              "  - {kind: mode_frequency, mode: 6, from_cycle: 2000, value: -0.02, ramp_s: 5}\n"
              "  - {kind: mode_damping, value: 0.5}\n"
              "  - {kind: sensor_gain, channel: s2, value: 1.1, run: 1}\n"
              "  - {kind: sensor_noise, value: 3}\n"
              "  - {kind: actuator_gain, channel: a2, value: 0.9, ramp_s: 0.5}\n",
          "")
          .simulation.faults;
  const SimulationSpec::Fault expected[] = {{Kind::mode_frequency, 6, 2000, 1, -1, -0.02, 5.0},
                                            {Kind::mode_damping, -1, 0, 1, -1, 0.5},
                                            {Kind::sensor_gain, 1, 0, 1, 1, 1.1},
                                            {Kind::sensor_noise, -1, 0, 1, -1, 3.0},
                                            {Kind::actuator_gain, 1, 0, 1, -1, 0.9, 0.5}};
  ASSERT_EQ(faults.size(), std::size(expected));
  for (std::size_t i = 0; i < faults.size(); ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(faults[i].kind, expected[i].kind);
    EXPECT_EQ(faults[i].channel, expected[i].channel);
    EXPECT_EQ(faults[i].from_cycle, expected[i].from_cycle);
    EXPECT_EQ(faults[i].run, expected[i].run);
    EXPECT_EQ(faults[i].value, expected[i].value);
    EXPECT_EQ(faults[i].ramp_s, expected[i].ramp_s);
  }
}

// Otherwise the node stops the stage before the host has sent a lost frame again.
TEST(Configs, TheWatchdogOutlastsARepetition) {
  const std::filesystem::path file = kConfigs / "stage/small_stage_can.yaml";
  const std::string text = load_stage_config(file).text;
  const auto watchdog_s = [&](const std::string& keys) {
    return parse_stage_config(file, text + keys, "").can.spec.watchdog_s;
  };
  EXPECT_EQ(watchdog_s(""), 20e-3);
  EXPECT_GT(watchdog_s("  reply_timeout_s: 0.05\n"), kCanRepeats * 0.05);
  EXPECT_EQ(watchdog_s("  watchdog_s: 16e-3\n"), 16e-3);
  EXPECT_THROW(watchdog_s("  watchdog_s: 15e-3\n"), FormatError);
  EXPECT_EQ(watchdog_s("  watchdog_s: 15e-3\npace: 1\n"), 15e-3) << "nothing is repeated";
  EXPECT_THROW(watchdog_s("  watchdog_s: 0.9e-3\npace: 1\n"), FormatError);
}

// The file for can-utils and SavvyCAN is what `config dbc` writes for the wafer stage today.
TEST(Configs, TheDatabaseOfFramesIsOfTheWaferStage) {
  const StageConfig stage = load_stage_config(kConfigs / "stage/wafer_stage_can.yaml");
  EXPECT_EQ(read_whole_file(std::filesystem::path(STAGEID_SOURCE_DIR) / "docs/wafer_stage_can.dbc"),
            can_dbc(can_layout(stage.can.spec, stage.spec.info), stage.spec.info));
}

TEST(Configs, TheMainJobHasItsNumbers) {
  const ExperimentConfig config =
      load_experiment_config(kConfigs / "experiment/wafer_stage_quick.yaml");
  const ExperimentPlan plan = make_plan(config);
  EXPECT_EQ(plan.grid().size(), 4000);
  EXPECT_EQ(plan.grid().frequency_hz()[0], 0.25);
  EXPECT_EQ(plan.grid().frequency_hz()[3999], 1999.75);
  EXPECT_EQ(plan.experiments(), 13);
  EXPECT_EQ(plan.runs().size(), 39U);
  EXPECT_EQ(plan.samples_per_run(), 4 * 40000);
  EXPECT_EQ(config.validation_realization, 2);
  EXPECT_EQ(config.frf.outputs.size(), 4U);
}

TEST(Configs, ThePaperScaleHasItsNumbers) {
  const ExperimentPlan plan =
      make_plan(load_experiment_config(kConfigs / "experiment/wafer_stage_paper.yaml"));
  EXPECT_EQ(plan.runs().size(), 130U);
  EXPECT_EQ(plan.samples_per_run(), 11 * 40000);
}

void expect_same_channels(const std::vector<Channel>& a, const std::vector<Channel>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].name, b[i].name);
    EXPECT_EQ(a[i].unit, b[i].unit);
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(a[i].position_m[k], b[i].position_m[k]) << a[i].name;
      EXPECT_EQ(a[i].direction[k], b[i].direction[k]) << a[i].name;
    }
  }
}

TEST(Configs, TheWaferStageIsTheOneThatTheLibrariesAreTestedWith) {
  const StageConfig config = load_stage_config(kConfigs / "stage/wafer_stage.yaml");
  const StageSpec& file = config.spec;
  const test::SimulatedSpec code = test::wafer_stage_spec();
  expect_same_channels(file.info.actuators, code.info.actuators);
  expect_same_channels(file.info.sensors, code.info.sensors);
  EXPECT_EQ(file.info.sample_rate_hz, code.info.sample_rate_hz);
  EXPECT_EQ(file.info.delay_s, code.info.delay_s);
  EXPECT_EQ(file.limits.actuator_n, code.limits.actuator_n);
  EXPECT_EQ(file.limits.slew_n_s, code.limits.slew_n_s);
  EXPECT_EQ(file.limits.thermal_rms_n, code.limits.thermal_rms_n);
  EXPECT_EQ(file.limits.position_window_m, code.limits.position_window_m);
  EXPECT_EQ(config.simulation.sensor_noise_m, code.simulation.sensor_noise_m);
  EXPECT_EQ(config.simulation.sensor_noise_coloured_m, code.simulation.sensor_noise_coloured_m);
  EXPECT_EQ(config.simulation.force_noise_n, code.simulation.force_noise_n);
  const std::vector<PlantMode> a = plant_modes(file.info, config.plant.value());
  const std::vector<PlantMode> b = plant_modes(code.info, code.plant);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].natural_frequency_hz, b[i].natural_frequency_hz);
    EXPECT_EQ(a[i].damping_ratio, b[i].damping_ratio);
    EXPECT_EQ(a[i].actuator_shape, b[i].actuator_shape);
    EXPECT_EQ(a[i].sensor_shape, b[i].sensor_shape);
  }
  EXPECT_EQ(file.controller.actuator_decoupling, code.controller.actuator_decoupling);
  EXPECT_EQ(file.controller.sensor_decoupling, code.controller.sensor_decoupling);
  ASSERT_EQ(file.controller.axes.size(), code.controller.axes.size());
  for (std::size_t i = 0; i < file.controller.axes.size(); ++i) {
    EXPECT_EQ(file.controller.axes[i].gain, code.controller.axes[i].gain);
    EXPECT_EQ(file.controller.axes[i].lowpass_hz, code.controller.axes[i].lowpass_hz);
  }
}

TEST(Configs, SeventeenModesOfTheWaferStageAreSeenBelowTwoKilohertz) {
  const StageConfig config = load_stage_config(kConfigs / "stage/wafer_stage.yaml");
  int below = 0;
  for (const PlantMode& mode :
       flexible_modes_seen(config.spec.info, config.plant.value(), {"z1", "z5", "z13"},
                           {"sz1", "sz2", "sz3", "sz4"}))
    below += mode.natural_frequency_hz < 2000.0 ? 1 : 0;
  EXPECT_EQ(below, test::kModesInBand);
  EXPECT_EQ(flexible_modes_seen(config.spec.info, *config.plant, {"z1"}, {"sx1"}).size(),
            0U);  // x sensors observe none of z
}

TEST(Configs, TheMeasurementIsAnotherIfStageOrExcitationChange) {
  const ExperimentConfig quick =
      load_experiment_config(kConfigs / "experiment/wafer_stage_quick.yaml");
  const ExperimentConfig paper =
      load_experiment_config(kConfigs / "experiment/wafer_stage_paper.yaml");
  const ExperimentConfig again =
      load_experiment_config(kConfigs / "experiment/wafer_stage_quick.yaml");
  EXPECT_EQ(quick.measurement_id, again.measurement_id);
  EXPECT_NE(quick.measurement_id, paper.measurement_id);
}

}  // namespace stageid::test_configs
