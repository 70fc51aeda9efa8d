#include "tools/node_command.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <thread>

#include "hal/pacer.hpp"
#include "tools/command_line.hpp"
#include "tools/interrupt.hpp"
#include "tools/stage_config.hpp"

namespace stageid {
namespace {

constexpr double kGravity_m_s2 = 9.81;
constexpr std::size_t kCompensators = 3;
constexpr double kRoom_k = 295.0;
constexpr double kHot_k = 320.0;

/// What the stage rests on, inside the ranges that its supervisor expects.
NodePanel panel_of(const StageConfig& config) {
  NodePanel panel;
  const double share_n = config.spec.mass_kg * kGravity_m_s2 / kCompensators;
  PlantConditions ranges;
  ranges.gravity_low_n = 0.5 * share_n;
  ranges.gravity_high_n = 1.5 * share_n;
  ranges.temperature_low_k = 2.0 * kRoom_k - kHot_k;
  ranges.temperature_high_k = kHot_k;
  if (config.supervisor) ranges = config.supervisor->conditions;
  panel.gravity_low_n = ranges.gravity_low_n;
  panel.gravity_high_n = ranges.gravity_high_n;
  panel.temperature_high_k = ranges.temperature_high_k;
  panel.gravity_compensator_n.assign(kCompensators,
                                     0.5 * (ranges.gravity_low_n + ranges.gravity_high_n));
  panel.temperature_k.assign(1, 0.5 * (ranges.temperature_low_k + ranges.temperature_high_k));
  return panel;
}

/// The plant of the stage file; its time is the host's, sample by sample.
std::unique_ptr<StageNode> make_node(const StageConfig& config, const NodeOptions& options) {
  WaferStageSpec spec = config.spec;
  spec.pace = 0.0;
  spec.info.clock = Clock::virtual_time;
  return std::make_unique<StageNode>(std::make_unique<SimulatedStage>(spec), spec.limits,
                                     spec.controller, panel_of(config), options);
}

}  // namespace

NodeCommand::NodeCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command =
      add_command(app, "node", "Serve the simulated stage of a stage file to other processes");
  command->add_option("config", config_, "stage file (.yaml)")->required();
  modbus_.add_options(*command);
  command
      ->add_option("--watchdog", options_.watchdog_s,
                   "s; a host that is silent for longer while it measures ends in a safe stop; "
                   "0: 3 samples")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->final_callback([this] { run(); });
}

void NodeCommand::run() {
  if (!modbus_.wanted())
    throw std::invalid_argument("node: no door; give --modbus-tcp PORT or --modbus-rtu DEVICE");
  const StageConfig config = load_stage_config(config_);
  const std::unique_ptr<StageNode> node = make_node(config, options_);
  modbus_.start(*node, config.spec.limits);
  for (const std::string& place : modbus_.places())
    console_.result(fmt::format("{}: served on {}", config.spec.info.name, place));
  std::fflush(stdout);
  std::string trouble;
  while (!interrupt_flag()) {
    node->tick(monotonic_ns());
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const std::string now = node->trouble();
    if (now != trouble && !now.empty()) console_.warning(fmt::format("node: {}", now));
    trouble = now;
  }
  modbus_.stop();
}

}  // namespace stageid
