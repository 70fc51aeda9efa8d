#pragma once

#include <optional>

#include "hal/modbus/modbus_address.hpp"
#include "hal/modbus/modbus_supervisor.hpp"
#include "hal/stage/plant_watch.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// The group `modbus`: address and timing of a Modbus server.
struct ModbusConfig {
  ModbusAddress address;
  ModbusTiming timing;
};

/// The group `supervisor` of a stage file: the plant around the stage, for any back end.
struct SupervisorConfig {
  /// Fast enough to repeat a poll before the status is stale after three periods.
  ModbusConfig link{{}, {0.08, 0.15, 1e-3}};
  ModbusSupervisorOptions options;
  PlantConditions conditions;
};

/// Describes the groups `modbus` and `supervisor`; the first is required if the stage is `behind_modbus`.
void describe_modbus_groups(ConfigVisitor& visitor, bool behind_modbus,
                            std::optional<ModbusConfig>& stage,
                            std::optional<SupervisorConfig>& supervisor);

}  // namespace stageid
