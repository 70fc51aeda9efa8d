#pragma once

#include <optional>

#include "hal/modbus/modbus_supervisor.hpp"
#include "hal/modbus/modbus_wire.hpp"
#include "hal/stage/plant_watch.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// The group `modbus`: where a Modbus server is and what may be expected of it.
struct ModbusConfig {
  ModbusAddress address;
  ModbusTiming timing;
};

/// The group `supervisor` of a stage file: the plant around the stage, whatever its back end.
struct SupervisorConfig {
  /// So quick that a poll can be repeated before three periods are over and its status is stale.
  ModbusConfig link{{}, {0.08, 0.15, 1e-3}};
  ModbusSupervisorOptions options;
  PlantConditions conditions;
};

/// What a stage file says of Modbus.
struct ModbusGroups {
  std::optional<ModbusConfig> stage;
  std::optional<SupervisorConfig> supervisor;
};

/// The groups `modbus` and `supervisor`; the first is needed if the stage is `behind_modbus`.
void describe_modbus_groups(ConfigVisitor& visitor, bool behind_modbus, ModbusGroups& groups);

}  // namespace stageid
