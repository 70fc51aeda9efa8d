#include "tools/node_command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <stdexcept>

#include "hal/can_node.hpp"
#include "hal/can_socket.hpp"
#include "hal/faulty_can.hpp"
#include "tools/command_line.hpp"
#include "tools/interrupt.hpp"

namespace stageid {
namespace {

constexpr std::int64_t kTick_ns = 1'000'000;
constexpr std::int64_t kLongestStop_ns = 5'000'000'000;

bool forces_act(NodeState state) {
  return state == NodeState::operation_enabled || state == NodeState::measuring ||
         state == NodeState::quick_stop || state == NodeState::fault_reaction;
}

StageNode make_node(const StageConfig& config, double hold_s) {
  WaferStageSpec spec = config.spec;
  spec.pace = 0.0;  // whoever asks for samples sets the pace
  NodeOptions options;
  options.watchdog_s = config.can.spec.watchdog_s;
  options.hold_s = hold_s;
  return {std::make_unique<SimulatedStage>(spec), spec.limits, spec.controller, NodePanel{},
          options};
}

/// The interfaces of the command line take the place of those in the file.
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

}  // namespace

NodeCommand::NodeCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(
      app, "node", "Serve the simulated stage of a stage file to others, until SIGINT or SIGTERM");
  command->add_option("config", config_, "stage file (.yaml)")->required();
  command
      ->add_option("--can", can_interfaces_,
                   "CAN FD interfaces, one for every bus of the file, in its order: can0,can1")
      ->delimiter(',');
  command
      ->add_option("--can-fault", can_faults_,
                   "spoil measurement frames: lost@100x3, repeated@, swapped@, late@100:0.004, "
                   "corrupt@, shortened@, foreign@ (KIND@FRAME[xCOUNT][:SECONDS])")
      ->delimiter(',');
  command
      ->add_option("--pace", pace_,
                   "of resident experiments; 0: as fast as possible, 1: wall clock")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--hold", hold_s_,
                   "seconds that the node holds the stage in its own loop before it cuts the power")
      ->check(CLI::Range(0.0, 60.0))
      ->capture_default_str();
  command->final_callback([this] { run(); });
}

void NodeCommand::run() const {
  if (can_interfaces_.empty())
    throw std::invalid_argument("node: nothing to serve; add --can INTERFACE");
  const StageConfig config = load_stage_config(config_);
  StageNode node = make_node(config, hold_s_);
  serve_can(config, node);
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
  CanNode front(node, layout, transport, pace_);
  console_.result(fmt::format("'{}' on {}; SIGINT or SIGTERM ends it", config.spec.info.name,
                              fmt::join(can_interfaces_, ", ")));
  std::fflush(stdout);  // who waits for the node to be there reads this line
  while (!interrupt_flag()) front.serve(socket.now_ns() + kTick_ns);

  static_cast<void>(node.request(SupervisorCommand::quick_stop));
  const std::int64_t give_up_ns = socket.now_ns() + kLongestStop_ns;
  static_cast<void>(node.request(SupervisorCommand::disable));
  while (forces_act(node.state()) && socket.now_ns() < give_up_ns)
    front.serve(socket.now_ns() + kTick_ns);
  console_.result(fmt::format("at rest: {}", to_string(node.state())));
}

}  // namespace stageid
