#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "hal/modbus/modbus_fault.hpp"
#include "hal/modbus/modbus_node.hpp"
#include "hal/modbus/modbus_server.hpp"
#include "hal/modbus/modbus_stage.hpp"
#include "hal/node/stage_node.hpp"
#include "tests/hal/node/small_node.hpp"
#include "tests/hal/stage/fake_stage.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/process/pty_pair.hpp"

namespace stageid::test {

inline constexpr ModbusTiming kQuickTiming = {0.4, 1.2, 1e-3};

inline std::vector<ModbusFault> modbus_faults(const std::vector<std::string>& texts) {
  std::vector<ModbusFault> faults;
  for (const std::string& text : texts) faults.push_back(parse_modbus_fault(text));
  return faults;
}

/// A server in a separate thread, on a free TCP port or on one end of a pty pair.
class ServerThread {
 public:
  ServerThread(ModbusRegisters& registers, ModbusFaultScript* faults, bool serial = false,
               int port = 0)
      : line_(serial ? std::make_unique<PtyPair>() : nullptr),
        server_(here(port), registers, faults),
        thread_([this] { server_.run(stop_); }) {}
  ~ServerThread() {
    stop_ = true;
    thread_.join();
  }
  ServerThread(ServerThread&&) = delete;

  /// The address for a client.
  ModbusAddress address() const {
    ModbusAddress address = server_.address();
    if (line_) address.device = line_->first();
    return address;
  }

 private:
  ModbusAddress here(int port) const {
    ModbusAddress address;
    address.port = port;
    address.parity = 'N';  // a pty cannot be opened twice with other parities
    if (line_) address.device = line_->second();
    return address;
  }

  std::unique_ptr<PtyPair> line_;
  ModbusServer server_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

/// A node with two actuators and one sensor at 50 Hz behind Modbus.
class ModbusBench {
 public:
  /// A safe stop holds the stage for less than a sample, so only the host moves it.
  explicit ModbusBench(const std::vector<std::string>& faults = {}, bool serial = false,
                       double heartbeat_s = 1.0, NodePanel panel = good_panel())
      : script_(modbus_faults(faults)),
        node_(make_stage(&fake), small_limits(), one_axis_controller(50.0, 1.0, 1.0),
              std::move(panel), {10.0, 0.01}),
        registers_(node_, small_limits(), kBootId, &script_, heartbeat_s),
        server_(std::make_unique<ServerThread>(registers_, &script_, serial)) {}

  static constexpr std::uint32_t kBootId = 4711;

  static StageInfo info() { return FakeStage(2, 1, 50.0).info(); }

  ModbusAddress address() const { return server_->address(); }
  StageNode& node() { return node_; }
  ModbusNode& registers() { return registers_; }
  /// Ends the server, so that the fake stage may be examined.
  void stop() { server_.reset(); }
  /// Another server, on the same port.
  void restart(int port) {
    server_ = std::make_unique<ServerThread>(registers_, &script_, false, port);
  }

  FakeStage* fake = nullptr;

 private:
  static std::unique_ptr<CyclicStage> make_stage(FakeStage** fake) {
    auto stage = std::make_unique<FakeStage>(2, 1, 50.0);
    stage->measurement = {1.25e-3};
    *fake = stage.get();
    return stage;
  }

  ModbusFaultScript script_;
  StageNode node_;
  ModbusNode registers_;
  std::unique_ptr<ServerThread> server_;
};

/// The host's side of a server.
struct ModbusHost {
  explicit ModbusHost(const ModbusAddress& address, const StageInfo& info = ModbusBench::info(),
                      const ModbusHostOptions& options = {})
      : stage(info, address, kQuickTiming, options), driver(stage) {}
  void start(std::uint64_t seed = 1) { driver.start(seed); }
  Outcome exchange(double u0 = 0.0, double u1 = 0.0) {
    driver.u = {u0, u1};
    driver.inputs.cycle = cycle++;
    return driver.step();
  }

  ModbusStage stage;
  Driver driver;
  const std::vector<double>& y = driver.y;
  const Inputs& inputs = driver.inputs;
  std::uint64_t cycle = 0;
};

}  // namespace stageid::test
