#pragma once

#include "hal/modbus_supervisor.hpp"
#include "hal/modbus_wire.hpp"
#include "hal/plant_watch.hpp"
#include "tools/config_visitor.hpp"

namespace stageid {

/// The group `modbus`: where a Modbus server is and what may be expected of it.
struct ModbusConfig {
  ModbusAddress address;
  ModbusTiming timing;
};

/// The group `supervisor` of a stage file: the plant around the stage, whatever its back end.
struct SupervisorConfig {
  ModbusConfig link;
  ModbusSupervisorOptions options;
  PlantConditions conditions;
};

void describe_modbus(ConfigVisitor& visitor, ModbusConfig& config);
void describe_supervisor(ConfigVisitor& visitor, SupervisorConfig& config);

}  // namespace stageid
