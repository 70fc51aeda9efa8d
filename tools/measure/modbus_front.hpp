#pragma once

#include <CLI/CLI.hpp>
#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "hal/modbus/modbus_fault.hpp"
#include "hal/modbus/modbus_node.hpp"
#include "hal/modbus/modbus_server.hpp"
#include "hal/node/stage_node.hpp"

namespace stageid {

/// The Modbus side of `stageid node`: its options, and one server thread per connection (TCP, RTU) to the same
/// StageNode. Every server has its own request count and faults.
class ModbusFront {
 public:
  ModbusFront() = default;
  ~ModbusFront() { stop(); }
  ModbusFront(const ModbusFront&) = delete;
  ModbusFront& operator=(const ModbusFront&) = delete;

  void add_options(CLI::App& command);
  bool wanted() const noexcept { return tcp_port_ >= 0 || !rtu_device_.empty(); }

  /// Opens the requested connections and serves them. `node` must outlive the front.
  /// @throws std::invalid_argument for unknown faults or invalid values.
  /// @throws StageError if a port or device cannot be opened.
  void start(StageNode& node, const StageLimits& limits);
  /// Ends the threads and closes the connections.
  void stop();
  /// One line per connection, after start().
  std::vector<std::string> places() const;

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
    std::thread thread;
  };

  int tcp_port_ = -1;
  std::string rtu_device_;
  int baud_ = 115200;
  std::string parity_ = "E";
  int unit_ = 1;
  std::vector<std::string> faults_;
  std::vector<std::unique_ptr<Door>> doors_;
  std::atomic<bool> stop_ = false;
};

}  // namespace stageid
