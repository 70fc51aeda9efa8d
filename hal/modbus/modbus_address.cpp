#include "hal/modbus/modbus_address.hpp"

#include <fmt/format.h>

namespace stageid {
namespace {

constexpr double kCharacterBits = 11.0;  // start, 8 data, parity or second stop, stop
constexpr double kSilentCharacters = 3.5;
constexpr int kFastBaud = 19200;  // above: fixed intervals
constexpr double kFastSilence_s = 1.75e-3;

// unit, function, two addresses, two counts, byte count, CRC
int request_bytes(int registers) { return 13 + 2 * registers; }
// unit, function, byte count, CRC
int reply_bytes(int registers) { return 5 + 2 * registers; }

}  // namespace

std::string to_string(const ModbusAddress& address) {
  if (address.serial())
    return fmt::format("Modbus RTU {} ({} baud, parity {}), unit {}", address.device, address.baud,
                       address.parity, address.unit);
  return fmt::format("Modbus TCP {}:{}, unit {}", address.host, address.port, address.unit);
}

double modbus_transaction_s(const ModbusAddress& address, const ModbusTiming& timing,
                            int written_registers, int read_registers) {
  if (!address.serial()) return timing.device_s;
  const double character_s = kCharacterBits / address.baud;
  const double silence_s =
      address.baud > kFastBaud ? kFastSilence_s : kSilentCharacters * character_s;
  return (request_bytes(written_registers) + reply_bytes(read_registers)) * character_s +
         2.0 * silence_s + timing.device_s;
}

double modbus_longest_pause_s(const ModbusTiming& timing, double sample_rate_hz) {
  return timing.worst_reply_s + timing.response_s + 1.0 / sample_rate_hz;
}

std::string describe_transaction(const ModbusAddress& address, const ModbusTiming& timing,
                                 int written_registers, int read_registers) {
  const double milliseconds =
      1e3 * modbus_transaction_s(address, timing, written_registers, read_registers);
  if (!address.serial()) return fmt::format("{:.3g} ms (reply time of the device)", milliseconds);
  return fmt::format("{:.3g} ms ({} + {} bytes at {} baud)", milliseconds,
                     request_bytes(written_registers), reply_bytes(read_registers), address.baud);
}

}  // namespace stageid
