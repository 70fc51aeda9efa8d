#pragma once

#include <memory>

#include "hal/modbus/modbus_stage.hpp"
#include "hal/modbus/modbus_supervisor.hpp"
#include "hal/stage/plant_watch.hpp"
#include "tools/config/modbus_config.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid {

/// The stage behind the Modbus server of the stage file, which has a group `modbus`.
/// @throws std::invalid_argument if the link cannot carry its rate or channels.
std::unique_ptr<CyclicStage> make_modbus_stage(const StageConfig& config,
                                               const ModbusHostOptions& options);

/// The plant around the stage, up and watched as long as this lives.
class SupervisedPlant {
 public:
  /// @throws StageError if it does not come up.
  SupervisedPlant(const SupervisorConfig& config, bool reset_fault);
  const PlantWatch& watch() const noexcept { return watch_; }
  PlantSnapshot snapshot() const { return supervisor_.snapshot(); }

 private:
  ModbusSupervisor supervisor_;
  PlantWatch watch_;
};

}  // namespace stageid
