#include "tools/measure/modbus_backend.hpp"

namespace stageid {

std::unique_ptr<CyclicStage> make_modbus_stage(const StageConfig& config,
                                               const ModbusHostOptions& options) {
  const ModbusConfig& modbus = config.modbus.value();
  return std::make_unique<ModbusStage>(config.spec.info, modbus.address, modbus.timing, options);
}

SupervisedPlant::SupervisedPlant(const SupervisorConfig& config, bool reset_fault)
    : supervisor_(config.link.address, config.link.timing, config.options),
      watch_(supervisor_, config.conditions, reset_fault) {}

}  // namespace stageid
