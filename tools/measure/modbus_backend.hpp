#pragma once

#include <memory>

#include "hal/modbus/modbus_stage.hpp"
#include "hal/modbus/modbus_supervisor.hpp"
#include "hal/stage/plant_watch.hpp"
#include "tools/config/modbus_config.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid {

/// The stage at the Modbus server in the group `modbus` of the stage file.
/// @throws std::invalid_argument if the link cannot carry the sample rate or channels.
std::unique_ptr<CyclicStage> make_modbus_stage(const StageConfig& config,
                                               const ModbusHostOptions& options);

/// The plant around the stage, operated and monitored during the lifetime of this object.
class SupervisedPlant {
 public:
  /// @throws StageError if it does not start.
  SupervisedPlant(const SupervisorConfig& config, bool reset_fault);
  const PlantWatch& watch() const noexcept { return watch_; }
  PlantSnapshot snapshot() const { return supervisor_.snapshot(); }

 private:
  ModbusSupervisor supervisor_;
  PlantWatch watch_;
};

}  // namespace stageid
