#pragma once

#include <memory>
#include <string>

// libmodbus' own name for its handle, declared here to keep its header out of other files.
struct _modbus;  // NOLINT(bugprone-reserved-identifier)

namespace stageid {

/// Address of a Modbus server: TCP, or RTU on a serial line if `device` is not empty.
struct ModbusAddress {
  std::string host = "127.0.0.1";
  int port = 502;
  std::string device;  ///< "/dev/ttyUSB0"
  int baud = 115200;
  char parity = 'E';  ///< 'N', 'E', 'O'; 'N' implies a second stop bit
  int unit = 1;

  bool serial() const noexcept { return !device.empty(); }
};

/// "Modbus TCP 127.0.0.1:502, unit 1".
std::string to_string(const ModbusAddress& address);

struct ModbusContextFree {
  void operator()(_modbus* context) const noexcept;
};
using ModbusContext = std::unique_ptr<_modbus, ModbusContextFree>;

/// A handle for this address, not connected. libmodbus' own error recovery is disabled, because it blocks
/// forever when the peer is gone.
/// @throws std::invalid_argument if libmodbus refuses the address (unit, baud rate, parity).
ModbusContext make_modbus_context(const ModbusAddress& address);

struct ModbusTiming {
  double response_s = 0.2;     ///< a later reply counts as missing
  double worst_reply_s = 0.5;  ///< no reply is expected after this time; > response_s
  double device_s = 0.001;     ///< normal processing time of the server
};

/// Duration of one FC23 transaction that writes w and reads r registers:
///   RTU: (13 + 2 w + 5 + 2 r) 11 bits / baud + 2 silent intervals + device_s,
///        silent interval: 3.5 characters, above 19200 baud 1.75 ms
///   TCP: device_s; the time on the wire is negligible
/// Source: Modbus over Serial Line, Specification and Implementation Guide V1.02, 2.5.1.
double modbus_transaction_s(const ModbusAddress& address, const ModbusTiming& timing,
                            int written_registers, int read_registers);

/// Longest time between two new setpoints of a run that continues: a request or its reply was lost, so it is
/// repeated after worst_reply_s and answered within response_s; the next setpoint follows a sample later. The
/// watchdog of a node must be longer.
double modbus_longest_pause_s(const ModbusTiming& timing, double sample_rate_hz);

/// Text for the user: "13.2 ms (81 + 33 bytes at 115200 baud)".
std::string describe_transaction(const ModbusAddress& address, const ModbusTiming& timing,
                                 int written_registers, int read_registers);

}  // namespace stageid
