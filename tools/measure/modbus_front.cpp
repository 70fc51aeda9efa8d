#include "tools/measure/modbus_front.hpp"

#include <chrono>
#include <stdexcept>

namespace stageid {
namespace {

/// Different for every start, so that hosts detect a restarted node.
std::uint32_t fresh_boot_id() {
  const auto now_ns = static_cast<std::uint64_t>(
      std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1));
  const auto id = static_cast<std::uint32_t>((now_ns * 0x9E3779B97F4A7C15U) >> 32);
  return id == 0 ? 1 : id;
}

}  // namespace

void ModbusFront::stop() {
  stop_ = true;
  for (const std::unique_ptr<Door>& door : doors_)
    if (door->thread.joinable()) door->thread.join();
  doors_.clear();
}

void ModbusFront::add_options(CLI::App& command) {
  command
      .add_option("--modbus-tcp", tcp_port_,
                  "Modbus TCP port on the loopback interface; 0: a free one")
      ->check(CLI::Range(0, 65535));
  command.add_option("--modbus-rtu", rtu_device_, "Modbus RTU on this serial line");
  command.add_option("--modbus-baud", baud_, "baud rate of the serial line")->capture_default_str();
  command.add_option("--modbus-parity", parity_, "N | E | O")
      ->check(CLI::IsMember({"N", "E", "O"}))
      ->capture_default_str();
  command.add_option("--modbus-unit", unit_, "unit identifier of the node")
      ->check(CLI::Range(1, 247))
      ->capture_default_str();
  command.add_option(
      "--modbus-fault", faults_,
      "KIND[@REQUEST][xCOUNT][:VALUE], counted from the first request: late_reply:SECONDS, "
      "half_frame, wrong_unit, exception:CODE, dead_server, heartbeat, interlock, "
      "temperature:KELVIN, gravity:NEWTON");
}

void ModbusFront::start(StageNode& node, const StageLimits& limits) {
  std::vector<ModbusFault> faults;
  for (const std::string& text : faults_) {
    try {
      faults.push_back(parse_modbus_fault(text));
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(std::string("--modbus-fault: ") + error.what());
    }
  }
  ModbusAddress address;
  address.unit = unit_;
  const std::uint32_t boot_id = fresh_boot_id();
  const auto open = [&] {
    doors_.push_back(std::make_unique<Door>(address, node, limits, boot_id, faults));
  };
  if (tcp_port_ >= 0) {
    address.port = tcp_port_;
    open();
  }
  if (!rtu_device_.empty()) {
    address.device = rtu_device_;
    address.baud = baud_;
    address.parity = parity_.front();
    open();
  }
  for (const std::unique_ptr<Door>& door : doors_)
    door->thread = std::thread([this, server = &door->server] { server->run(stop_); });
}

std::vector<std::string> ModbusFront::places() const {
  std::vector<std::string> places;
  for (const std::unique_ptr<Door>& door : doors_)
    places.push_back(to_string(door->server.address()));
  return places;
}

}  // namespace stageid
