#include "hal/modbus/modbus_context.hpp"

#include <fmt/ranges.h>
#include <modbus/modbus.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "hal/stage/require.hpp"

namespace stageid {
namespace {

// libmodbus silently replaces other rates by 9600.
constexpr std::array kBaudRates = {1200,    2400,    4800,    9600,    19200,   38400,   57600,
                                   115200,  230400,  460800,  500000,  576000,  921600,  1000000,
                                   1152000, 1500000, 2000000, 2500000, 3000000, 3500000, 4000000};

}  // namespace

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

}  // namespace stageid
