#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "hal/can/can_node.hpp"
#include "hal/can/can_socket.hpp"
#include "hal/can/faulty_can.hpp"
#include "hal/node/stage_node.hpp"
#include "hal/stage/pacer.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/measure/modbus_front.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

constexpr std::int64_t kTick_ns = 1'000'000;
constexpr std::int64_t kLongestStop_ns = 5'000'000'000;

bool forces_act(NodeState state) {
  return state == NodeState::operation_enabled || state == NodeState::measuring ||
         state == NodeState::quick_stop || state == NodeState::fault_reaction;
}

constexpr double kGravity_m_s2 = 9.81;
constexpr std::size_t kCompensators = 3;
constexpr double kRoom_k = 295.0;
constexpr double kHot_k = 320.0;

/// Initial values of the supervisor panel, in the middle of the expected ranges.
NodePanel panel_of(const StageConfig& config) {
  const double share_n = config.spec.mass_kg * kGravity_m_s2 / kCompensators;
  PlantConditions ranges;
  ranges.gravity_low_n = 0.5 * share_n;
  ranges.gravity_high_n = 1.5 * share_n;
  ranges.temperature_low_k = 2.0 * kRoom_k - kHot_k;
  ranges.temperature_high_k = kHot_k;
  if (config.supervisor) ranges = config.supervisor->conditions;
  NodePanel panel;
  panel.gravity_low_n = ranges.gravity_low_n;
  panel.gravity_high_n = ranges.gravity_high_n;
  panel.temperature_high_k = ranges.temperature_high_k;
  panel.gravity_compensator_n.assign(kCompensators,
                                     0.5 * (ranges.gravity_low_n + ranges.gravity_high_n));
  panel.temperature_k.assign(1, 0.5 * (ranges.temperature_low_k + ranges.temperature_high_k));
  return panel;
}

/// Interfaces from the command line replace those in the file.
CanSpec can_spec(const StageConfig& config, const std::vector<std::string>& interfaces) {
  if (!config.can.present)
    throw std::invalid_argument(
        fmt::format("{}: has no group 'can'; see 'stageid config schema'", config.file.string()));
  CanSpec spec = config.can.spec;
  if (interfaces.size() != spec.buses.size())
    throw std::invalid_argument(fmt::format("--can: {} interfaces, but {} has {} buses",
                                            interfaces.size(), config.file.string(),
                                            spec.buses.size()));
  for (std::size_t i = 0; i < interfaces.size(); ++i) spec.buses[i].interface = interfaces[i];
  return spec;
}

void wait_a_tick(StageNode& node) {
  node.tick(monotonic_ns());
  std::this_thread::sleep_for(std::chrono::nanoseconds(kTick_ns));
}

/// Stops the stage and calls `serve` until it is at rest.
template <typename Serve>
void come_to_rest(StageNode& node, Serve serve) {
  static_cast<void>(node.request(SupervisorCommand::quick_stop));
  const std::int64_t give_up_ns = monotonic_ns() + kLongestStop_ns;
  static_cast<void>(node.request(SupervisorCommand::disable));
  while (forces_act(node.state()) && monotonic_ns() < give_up_ns) serve();
}

/// stageid node STAGE --can IF | --modbus-tcp PORT | --modbus-rtu DEVICE
///
/// One StageNode with one front end per requested kind of connection.
class NodeCommand {
 public:
  NodeCommand(CLI::App& app, Console& console);

 private:
  void run();
  StageNode make_node(const StageConfig& config) const;
  double watchdog_s(const StageConfig& config) const;
  void serve_can(const StageConfig& config, StageNode& node) const;

  Console& console_;
  std::filesystem::path config_;
  std::vector<std::string> can_interfaces_;
  std::vector<std::string> can_faults_;
  double pace_ = 0.0;
  double hold_s_ = 0.1;
  double watchdog_s_ = 0.0;
  ModbusFront modbus_;
};

NodeCommand::NodeCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(
      app, "node",
      "Serve the simulated stage of a stage file over CAN or Modbus, until SIGINT or SIGTERM");
  command->add_option("config", config_, "stage file (.yaml)")->required();
  command
      ->add_option(
          "--can", can_interfaces_,
          "CAN FD interfaces, one per bus of the stage file and in its order, such as can0,can1")
      ->delimiter(',');
  command
      ->add_option("--can-fault", can_faults_,
                   "KIND@FRAME[xCOUNT][:SECONDS]: disturb measurement frames, counted from 0. "
                   "Kinds: lost, repeated, swapped, late, corrupt, shortened, foreign. Example: "
                   "lost@100x3,late@500:0.004")
      ->delimiter(',');
  command
      ->add_option("--pace", pace_,
                   "speed of resident experiments. 0: as fast as possible; 1: wall clock")
      ->check(kNotNegative)
      ->capture_default_str();
  command
      ->add_option(
          "--hold", hold_s_,
          "seconds for which the node holds the stage in its own loop before it cuts the power")
      ->check(CLI::Range(0.0, 60.0))
      ->capture_default_str();
  modbus_.add_options(*command);
  command
      ->add_option(
          "--watchdog", watchdog_s_,
          "stop the stage if the host is silent for this many seconds. 0: over CAN, 'watchdog_s' "
          "of the group 'can'; over Modbus, the time of a repeated request plus one sample")
      ->check(CLI::Range(0.0, 3600.0));
  command->final_callback([this] { run(); });
}

StageNode NodeCommand::make_node(const StageConfig& config) const {
  WaferStageSpec spec = config.spec;
  spec.pace = 0.0;  // the requests for samples set the pace
  NodeOptions options;
  options.watchdog_s = watchdog_s(config);
  options.hold_s = hold_s_;
  return {std::make_unique<SimulatedStage>(spec), spec.limits, spec.controller, panel_of(config),
          options};
}

double NodeCommand::watchdog_s(const StageConfig& config) const {
  const StageInfo& info = config.spec.info;
  double pause_s = 0.0;
  // Without the group 'modbus', the host has another stage file; its times are probably the defaults.
  if (modbus_.wanted())
    pause_s = modbus_longest_pause_s(config.modbus ? config.modbus->timing : ModbusTiming{},
                                     info.sample_rate_hz);
  if (!can_interfaces_.empty() && config.can.mode == CanMode::streaming)
    pause_s = std::max(pause_s, can_longest_pause_s(config.can.spec, info));
  if (watchdog_s_ > 0.0 && watchdog_s_ < pause_s)
    throw std::invalid_argument(fmt::format(
        "--watchdog: {:.4g} s is too short: the node would stop the stage before a lost reply is "
        "repeated. Use more than {:.4g} s, or shorter reply times in the stage file",
        watchdog_s_, pause_s));
  if (watchdog_s_ > 0.0) return watchdog_s_;
  const double can_s = config.can.present ? config.can.spec.watchdog_s : 0.0;
  return std::max(can_s, pause_s + 1.0 / info.sample_rate_hz);
}

void NodeCommand::run() {
  if (can_interfaces_.empty() && !modbus_.wanted())
    throw std::invalid_argument(
        "node: nothing to serve; add --can INTERFACE, --modbus-tcp PORT or --modbus-rtu DEVICE");
  const StageConfig config = load_stage_config(config_);
  if (!config.spec.has_plant())
    throw FormatError(config_, "",
                      "the node simulates the stage, but there is no group 'plant'; add it");
  if (config.spec.controller.by_peer)
    throw FormatError(
        config_, "",
        "the node closes the loop, but its controller is 'peer'; write the controller");
  const ControlledStop comes_to_rest;
  StageNode node = make_node(config);
  if (modbus_.wanted()) modbus_.start(node, config.spec.limits);
  for (const std::string& place : modbus_.places())
    console_.result(
        fmt::format("'{}' on {}; SIGINT or SIGTERM ends it", config.spec.info.name, place));
  std::fflush(stdout);  // programs that wait for the node read these lines
  if (can_interfaces_.empty()) {
    while (!interrupt_flag()) wait_a_tick(node);
    come_to_rest(node, [&] { wait_a_tick(node); });
  } else {
    serve_can(config, node);
  }
  modbus_.stop();
  console_.result(fmt::format("at rest: {}", to_string(node.state())));
}

void NodeCommand::serve_can(const StageConfig& config, StageNode& node) const {
  const CanLayout layout = can_layout(can_spec(config, can_interfaces_), node.info());
  SocketCan socket(can_interfaces_, can_node_identifiers(layout));
  std::vector<CanFault> faults;
  for (const std::string& text : can_faults_) {
    try {
      faults.push_back(parse_can_fault(text));
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(fmt::format("--can-fault: {}", error.what()));
    }
  }
  FaultyCan transport(socket, faults);
  CanNode front(node, layout, transport, pace_, config.can.spec.node_clock);
  console_.result(fmt::format("'{}' on {}; SIGINT or SIGTERM ends it", config.spec.info.name,
                              fmt::join(can_interfaces_, ", ")));
  std::fflush(stdout);  // programs that wait for the node read this line
  while (!interrupt_flag()) front.serve(socket.now_ns() + kTick_ns);

  come_to_rest(node, [&] { front.serve(socket.now_ns() + kTick_ns); });
}

}  // namespace

std::shared_ptr<void> node_command(CLI::App& app, Console& console) {
  return std::make_shared<NodeCommand>(app, console);
}

}  // namespace stageid
