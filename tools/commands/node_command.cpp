#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "hal/can/can_node.hpp"
#include "hal/can/can_socket.hpp"
#include "hal/can/faulty_can.hpp"
#include "hal/modbus/modbus_fault.hpp"
#include "hal/modbus/modbus_node.hpp"
#include "hal/modbus/modbus_server.hpp"
#include "hal/node/stage_node.hpp"
#include "hal/stage/pacer.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

constexpr std::int64_t kTick_ns = 1'000'000;
constexpr std::int64_t kLongestStop_ns = 5'000'000'000;

/// The Modbus options of `stageid node`.
struct ModbusFlags {
  int tcp_port = -1;
  std::string rtu_device;
  int baud = 115200;
  std::string parity = "E";
  int unit = 1;
  std::vector<std::string> faults;

  bool wanted() const noexcept { return tcp_port >= 0 || !rtu_device.empty(); }
};

template <typename Parse>
auto parsed_faults(const char* option, const std::vector<std::string>& texts, Parse parse) {
  std::vector<decltype(parse(texts.front()))> faults;
  for (const std::string& text : texts) {
    try {
      faults.push_back(parse(text));
    } catch (const std::invalid_argument& error) {
      fail_request("{}: {}", option, error.what());
    }
  }
  return faults;
}

/// Different for every start, so that hosts detect a restarted node.
std::uint32_t fresh_boot_id() {
  const auto now_ns = static_cast<std::uint64_t>(
      std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1));
  const auto id = static_cast<std::uint32_t>((now_ns * 0x9E3779B97F4A7C15U) >> 32);
  return id == 0 ? 1 : id;
}

/// The Modbus side of `stageid node`: one server thread per connection (TCP, RTU) to the same StageNode. Every server
/// has its own request count and faults.
class ModbusFront {
 public:
  /// Opens the requested connections and serves them. `node` must outlive the front.
  /// @throws std::invalid_argument for unknown faults or invalid values.
  /// @throws StageError if a port or device cannot be opened.
  ModbusFront(const ModbusFlags& flags, StageNode& node, const StageLimits& limits)
      : ModbusFront() {  // from here on, the threads end after an exception too
    const auto faults = parsed_faults("--modbus-fault", flags.faults, parse_modbus_fault);
    ModbusAddress address;
    address.unit = flags.unit;
    const std::uint32_t boot_id = fresh_boot_id();
    const auto open = [&] {
      doors_.push_back(std::make_unique<Door>(address, node, limits, boot_id, faults));
    };
    if (flags.tcp_port >= 0) {
      address.port = flags.tcp_port;
      open();
    }
    if (!flags.rtu_device.empty()) {
      address.device = flags.rtu_device;
      address.baud = flags.baud;
      address.parity = flags.parity.front();
      open();
    }
    for (const std::unique_ptr<Door>& door : doors_)
      door->thread = std::jthread([this, server = &door->server] { server->run(stop_); });
  }
  /// Ends the threads and closes the connections.
  ~ModbusFront() { stop_ = true; }
  ModbusFront(ModbusFront&&) = delete;

  /// One line per connection.
  std::vector<std::string> places() const {
    std::vector<std::string> places;
    for (const std::unique_ptr<Door>& door : doors_)
      places.push_back(to_string(door->server.address()));
    return places;
  }

 private:
  struct Door {
    Door(const ModbusAddress& address, StageNode& node, const StageLimits& limits,
         std::uint32_t boot_id, std::vector<ModbusFault> list)
        : faults(std::move(list)),
          registers(node, limits, boot_id, &faults),
          server(address, registers, &faults) {}
    ModbusFaultScript faults;
    ModbusNode registers;
    ModbusServer server;
    std::jthread thread;  // ends before what it uses
  };

  ModbusFront() = default;

  std::atomic<bool> stop_ = false;
  std::vector<std::unique_ptr<Door>> doors_;
};

void add_modbus_options(CLI::App& command, ModbusFlags& flags) {
  add_value(command, "--modbus-tcp", flags.tcp_port, "PORT",
            "Modbus TCP port on the loopback interface; 0: a free one", CLI::Range(0, 65535));
  add_value(command, "--modbus-rtu", flags.rtu_device, "DEVICE", "Modbus RTU on this serial line");
  add_setting(command, "--modbus-baud", flags.baud, "BAUD", "baud rate of the serial line");
  add_setting(command, "--modbus-parity", flags.parity, "TEXT", "N | E | O",
              CLI::IsMember({"N", "E", "O"}));
  add_setting(command, "--modbus-unit", flags.unit, "ADDRESS", "unit identifier of the node",
              CLI::Range(1, 247));
  add_value(command, "--modbus-fault", flags.faults, "FAULT",
            "KIND[@REQUEST][xCOUNT][:VALUE]: inject a fault; requests are counted from 1. Kinds: "
            "late_reply:SECONDS, half_frame, wrong_unit, exception:CODE, dead_server, heartbeat, "
            "interlock, temperature:KELVIN, gravity:NEWTON");
}

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
  const double share_n = config.plant.value().mass_kg * kGravity_m_s2 / kCompensators;
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
    fail_request("{}: has no group 'can'; see 'stageid config schema'", config.file.string());
  CanSpec spec = config.can.spec;
  if (interfaces.size() != spec.buses.size())
    fail_request("--can: {} interfaces, but {} has {} buses", interfaces.size(),
                 config.file.string(), spec.buses.size());
  for (std::size_t i = 0; i < interfaces.size(); ++i) spec.buses[i].interface = interfaces[i];
  return spec;
}

/// Calls `serve` until the program is interrupted, then stops the stage and goes on until it is at rest.
template <typename Serve>
void serve_to_rest(StageNode& node, Serve serve) {
  while (!interrupt_flag()) serve();
  static_cast<void>(node.request(SupervisorCommand::quick_stop));
  const std::int64_t give_up_ns = monotonic_ns() + kLongestStop_ns;
  static_cast<void>(node.request(SupervisorCommand::disable));
  while (forces_act(node.state()) && monotonic_ns() < give_up_ns) serve();
}

/// stageid node STAGE --can IF | --modbus-tcp PORT | --modbus-rtu DEVICE
///
/// One StageNode with one front end per requested kind of connection.
struct NodeFlags {
  std::filesystem::path config;
  std::vector<std::string> can_interfaces;
  std::vector<std::string> can_faults;
  double pace = 0.0;
  double hold_s = 0.1;
  double watchdog_s = 0.0;
  ModbusFlags modbus;
};

double node_watchdog_s(const NodeFlags& flags, const StageConfig& config) {
  const StageInfo& info = config.spec.info;
  double pause_s = 0.0;
  // Without the group 'modbus', the host has another stage file; its times are probably the defaults.
  if (flags.modbus.wanted())
    pause_s = modbus_longest_pause_s(config.modbus ? config.modbus->timing : ModbusTiming{},
                                     info.sample_rate_hz);
  if (!flags.can_interfaces.empty() && config.can.mode == CanMode::streaming)
    pause_s = std::max(pause_s, can_longest_pause_s(config.can.spec, info));
  if (flags.watchdog_s > 0.0 && flags.watchdog_s < pause_s)
    fail_request(
        "--watchdog: {:.4g} s is too short: the node would stop the stage before a lost reply is "
        "repeated. Use more than {:.4g} s, or shorter reply times in the stage file",
        flags.watchdog_s, pause_s);
  if (flags.watchdog_s > 0.0) return flags.watchdog_s;
  const double can_s = config.can.present ? config.can.spec.watchdog_s : 0.0;
  return std::max(can_s, pause_s + 1.0 / info.sample_rate_hz);
}

StageNode make_node(const NodeFlags& flags, const StageConfig& config) {
  NodeOptions options;
  options.watchdog_s = node_watchdog_s(flags, config);
  options.hold_s = flags.hold_s;
  // In virtual time, because the requests for samples set the pace.
  return {
      std::make_unique<SimulatedStage>(config.spec.info, config.plant.value(), config.simulation),
      config.spec.limits, config.spec.controller, panel_of(config), options};
}

void serve_can(const NodeFlags& flags, Console& console, const StageConfig& config,
               StageNode& node) {
  const CanLayout layout = can_layout(can_spec(config, flags.can_interfaces), node.info());
  SocketCan socket(flags.can_interfaces, can_node_identifiers(layout));
  const auto faults = parsed_faults("--can-fault", flags.can_faults, parse_can_fault);
  FaultyCan transport(socket, faults);
  CanNode front(node, layout, transport, flags.pace, config.can.spec.node_clock);
  console.result("'{}' on {}; SIGINT or SIGTERM ends it", config.spec.info.name,
                 fmt::join(flags.can_interfaces, ", "));
  std::fflush(stdout);  // programs that wait for the node read this line
  serve_to_rest(node, [&] { front.serve(socket.now_ns() + kTick_ns); });
}

void serve(const NodeFlags& flags, Console& console) {
  if (flags.can_interfaces.empty() && !flags.modbus.wanted())
    fail_request(
        "node: nothing to serve; add --can INTERFACE, --modbus-tcp PORT or --modbus-rtu DEVICE");
  const StageConfig config = load_stage_config(flags.config);
  if (!config.plant)
    throw FormatError(flags.config, "",
                      "the node simulates the stage, but there is no group 'plant'; add it");
  if (config.spec.controller.by_peer)
    throw FormatError(
        flags.config, "",
        "the node closes the loop, but its controller is 'peer'; write the controller");
  const ControlledStop comes_to_rest;
  StageNode node = make_node(flags, config);
  std::optional<ModbusFront> modbus;
  if (flags.modbus.wanted()) {
    modbus.emplace(flags.modbus, node, config.spec.limits);
    for (const std::string& place : modbus->places())
      console.result("'{}' on {}; SIGINT or SIGTERM ends it", config.spec.info.name, place);
  }
  std::fflush(stdout);  // programs that wait for the node read these lines
  if (flags.can_interfaces.empty())
    serve_to_rest(node, [&node] {
      node.tick(monotonic_ns());
      std::this_thread::sleep_for(std::chrono::nanoseconds(kTick_ns));
    });
  else
    serve_can(flags, console, config, node);
  modbus.reset();
  console.result("at rest: {}", to_string(node.state()));
}

}  // namespace

void node_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(
      app, console, "node",
      "Serve the simulated stage of a stage file over CAN or Modbus, until SIGINT or SIGTERM",
      serve);
  add_required(command, "config", flags.config, "stage file (.yaml)");
  add_value(command, "--can", flags.can_interfaces, "INTERFACE",
            "CAN FD interfaces, one per bus, in the order of the stage file, such as can0,can1")
      ->delimiter(',');
  add_value(command, "--can-fault", flags.can_faults, "FAULT",
            "KIND@FRAME[xCOUNT][:SECONDS]: disturb measurement frames, counted from 0. "
            "Kinds: lost, repeated, swapped, late, corrupt, shortened, foreign. Example: "
            "lost@100x3,late@500:0.004")
      ->delimiter(',');
  add_setting(command, "--pace", flags.pace, "SPEED",
              "speed of resident experiments. 0: as fast as possible; 1: wall clock", kNotNegative);
  add_setting(command, "--hold", flags.hold_s, "SECONDS",
              "after a quick stop or a fault, seconds for which the node keeps the loop closed "
              "before it cuts the forces",
              CLI::Range(0.0, 60.0));
  add_modbus_options(command, flags.modbus);
  add_value(command, "--watchdog", flags.watchdog_s, "SECONDS",
            "stop the stage if the host is silent for this many seconds. Default, or 0: over CAN, "
            "'watchdog_s' of the group 'can'; over Modbus, the longest time that the host needs to "
            "repeat a lost request, plus one sample",
            CLI::Range(0.0, 3600.0));
}

}  // namespace stageid
