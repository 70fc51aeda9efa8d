#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/modbus/modbus_address.hpp"
#include "hal/modbus/modbus_answer.hpp"
#include "hal/modbus/modbus_fault.hpp"
#include "hal/modbus/modbus_request_frame.hpp"

namespace stageid {

/// A Modbus server for one unit, TCP (up to kMostClients clients) or RTU, with simulated faults.
///
/// It never waits for a client. A reply not read or a request not completed within kPatience_ms ends the
/// connection, and a client must read one reply before its next request is processed. If all places are taken,
/// a new client replaces the one that has been silent longest, except connections that the registers need.
/// Memory is bounded by kMostClients times one request and one reply.
///
/// A TCP request for another unit gets the exception of a gateway (11); on a serial line it is ignored.
/// Invalid bytes end a TCP connection. On a serial line they are skipped, and an incomplete request is
/// discarded at the next silence of kSilence_ms.
///
/// The server tolerates garbage but not attacks: Modbus has neither encryption nor authentication. Listen
/// only on the loopback interface or in a closed network.
class ModbusServer {
 public:
  static constexpr std::size_t kMostClients = 16;
  static constexpr int kSilence_ms = 50;
  static constexpr int kPatience_ms = 1000;

  /// TCP: listens on address.host and address.port (0: a free one). RTU: opens the device.
  /// `faults` may be null; it and `registers` must outlive the server.
  /// @throws StageError if the port is taken or the device cannot be opened.
  ModbusServer(const ModbusAddress& address, ModbusRegisters& registers, ModbusFaultScript* faults);
  ~ModbusServer();
  ModbusServer(ModbusServer&&) = delete;

  /// Contains the selected port.
  const ModbusAddress& address() const noexcept { return address_; }

  /// Waits up to wait_ms for work and processes it.
  void serve(int wait_ms);
  /// Serves until `stop`.
  void run(const std::atomic<bool>& stop);

 private:
  struct Line;

  void open();
  void serve_lines(int wait_ms);
  void work(Line& line, int events);
  void accept_clients();
  bool make_room();
  void receive(Line& line);
  void answer_next(Line& line);
  void answer(Line& line, ModbusRequest request);
  void reply(Line& line, const ModbusRequest& to, std::span<const std::uint8_t> pdu);
  void send(Line& line);
  void look_at_time(Line& line);
  void hang_up(const Line& line);
  const ModbusFault* fault(ModbusFault::Kind kind) const noexcept;

  ModbusAddress address_;
  ModbusRegisters& registers_;
  ModbusFaultScript* faults_;
  ModbusContext context_;  // opens ports and devices
  int listener_ = -1;
  std::vector<Line> lines_;
  ModbusConnection last_connection_ = 0;
  bool dead_ = false;
};

}  // namespace stageid
