#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "hal/modbus/modbus_fault.hpp"
#include "hal/modbus/modbus_pdu.hpp"
#include "hal/modbus/modbus_wire.hpp"

namespace stageid {

/// A Modbus server for one unit, TCP (any number of clients up to kMostClients) or RTU, that can
/// misbehave on request.
///
/// It never waits for a client: a reply that is not taken and a request that is not completed within
/// kPatience_ms end the connection, and a client reads one reply before its next request is looked
/// at. If all places are taken, a new client gets that of the one that has been silent longest, but
/// never that of a connection that the registers need. Memory is bounded: kMostClients times one
/// request and one reply.
///
/// A TCP request for another unit is refused as a gateway does (exception 11), one on a serial line
/// is not for us. Bytes that are no request end a TCP connection; on a serial line they are skipped,
/// and what is left of a request is thrown away at the next silence of kSilence_ms.
///
/// It stands up to garbage but not to an enemy: there is neither encryption nor authentication in
/// Modbus. Listen on the loopback interface or in a closed network only.
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
  ModbusServer(const ModbusServer&) = delete;
  ModbusServer& operator=(const ModbusServer&) = delete;

  /// With the port that was found.
  const ModbusAddress& address() const noexcept { return address_; }

  /// Waits up to wait_ms for something to do, and does it.
  void serve(int wait_ms);
  /// Serves until `stop`.
  void run(const std::atomic<bool>& stop);

 private:
  struct Line;
  struct Context;  // libmodbus', which opens ports and devices

  void open();
  void serve_lines(int wait_ms);
  void work(Line& line, int events);
  void accept_clients();
  bool make_room();
  void receive(Line& line);
  void answer_next(Line& line);
  void answer(Line& line, std::uint16_t transaction, std::uint8_t unit,
              std::span<const std::uint8_t> request);
  void reply(Line& line, std::uint16_t transaction, std::uint8_t unit,
             std::span<const std::uint8_t> pdu);
  void send(Line& line);
  void look_at_time(Line& line);
  void hang_up(const Line& line);
  const ModbusFault* fault(ModbusFault::Kind kind) const noexcept;

  ModbusAddress address_;
  ModbusRegisters& registers_;
  ModbusFaultScript* faults_;
  std::unique_ptr<Context> context_;
  int listener_ = -1;
  std::vector<Line> lines_;
  ModbusConnection last_connection_ = 0;
  bool dead_ = false;
};

}  // namespace stageid
