#pragma once

#include <memory>

#include "hal/modbus/modbus_wire.hpp"

// libmodbus' own name for its handle, so that its header stays in our sources.
struct _modbus;  // NOLINT(bugprone-reserved-identifier)

namespace stageid {

struct ModbusContextFree {
  void operator()(_modbus* context) const noexcept;
};
using ModbusContext = std::unique_ptr<_modbus, ModbusContextFree>;

/// A handle for this address, not connected. Its errors are ours to recover from: libmodbus' own
/// recovery of the link blocks for ever when the peer is gone.
/// @throws std::invalid_argument if libmodbus refuses the address (unit, baud rate, parity).
ModbusContext make_modbus_context(const ModbusAddress& address);

}  // namespace stageid
