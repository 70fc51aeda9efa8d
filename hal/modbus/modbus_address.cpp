#include "hal/modbus/modbus_address.hpp"

#include <fmt/ranges.h>
#include <modbus/modbus.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

constexpr double kCharacterBits = 11.0;  // start, 8 data, parity or second stop, stop
constexpr double kSilentCharacters = 3.5;
constexpr int kFastBaud = 19200;  // above: fixed intervals
constexpr double kFastSilence_s = 1.75e-3;

// libmodbus silently replaces other rates by 9600.
constexpr std::array kBaudRates = {1200,    2400,    4800,    9600,    19200,   38400,   57600,
                                   115200,  230400,  460800,  500000,  576000,  921600,  1000000,
                                   1152000, 1500000, 2000000, 2500000, 3000000, 3500000, 4000000};

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

void ModbusContextFree::operator()(_modbus* context) const noexcept {
  modbus_close(context);
  modbus_free(context);
}

ModbusContext make_modbus_context(const ModbusAddress& address) {
  ModbusContext context;
  if (address.serial()) {
    require(std::find(kBaudRates.begin(), kBaudRates.end(), address.baud) != kBaudRates.end(),
            "{}: unsupported baud rate; use one of {}", to_string(address),
            fmt::join(kBaudRates, ", "));
    context.reset(modbus_new_rtu(address.device.c_str(), address.baud, address.parity, 8,
                                 address.parity == 'N' ? 2 : 1));
  } else {
    context.reset(modbus_new_tcp(address.host.c_str(), address.port));
  }
  require(context != nullptr, "{}: refused: {}", to_string(address), modbus_strerror(errno));
  require(modbus_set_slave(context.get(), address.unit) == 0,
          "{}: unit out of range; give 1 to 247", to_string(address));
  modbus_set_error_recovery(context.get(), MODBUS_ERROR_RECOVERY_NONE);
  return context;
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
