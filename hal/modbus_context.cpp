#include "hal/modbus_context.hpp"

#include <fmt/format.h>
#include <modbus/modbus.h>

#include <cerrno>
#include <stdexcept>
#include <string>

namespace stageid {

void ModbusContextFree::operator()(_modbus* context) const noexcept {
  modbus_close(context);
  modbus_free(context);
}

ModbusContext make_modbus_context(const ModbusAddress& address) {
  ModbusContext context;
  if (address.serial()) {
    context.reset(modbus_new_rtu(address.device.c_str(), address.baud, address.parity, 8,
                                 address.parity == 'N' ? 2 : 1));
  } else {
    context.reset(modbus_new_tcp(address.host.c_str(), address.port));
  }
  if (!context)
    throw std::invalid_argument(
        fmt::format("{}: refused: {}", to_string(address), modbus_strerror(errno)));
  if (modbus_set_slave(context.get(), address.unit) != 0)
    throw std::invalid_argument(
        fmt::format("{}: there is no such unit; give 1 to 247", to_string(address)));
  modbus_set_error_recovery(context.get(), MODBUS_ERROR_RECOVERY_NONE);
  return context;
}

}  // namespace stageid
