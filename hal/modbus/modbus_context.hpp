#pragma once

#include <memory>

#include "hal/modbus/modbus_address.hpp"

// libmodbus' own name for its handle, declared here to keep its header out of other files.
struct _modbus;  // NOLINT(bugprone-reserved-identifier)

namespace stageid {

struct ModbusContextFree {
  void operator()(_modbus* context) const noexcept;
};
using ModbusContext = std::unique_ptr<_modbus, ModbusContextFree>;

/// A handle for this address, not connected. libmodbus' own error recovery is disabled, because it blocks
/// forever when the peer is gone.
/// @throws std::invalid_argument if libmodbus refuses the address (unit, baud rate, parity).
ModbusContext make_modbus_context(const ModbusAddress& address);

}  // namespace stageid
