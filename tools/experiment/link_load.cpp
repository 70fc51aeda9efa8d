#include "tools/experiment/link_load.hpp"

#include <fmt/format.h>

#include "hal/modbus/modbus_stage.hpp"

namespace stageid {

std::vector<LinkLoad> link_loads(const StageConfig& config) {
  const StageInfo& info = config.spec.info;
  if (config.backend == Backend::can && config.can.present && config.can.mode == CanMode::streaming)
    return can_bus_load(config.can.spec, can_layout(config.can.spec, info), info.sample_rate_hz);
  if (config.backend == Backend::modbus && config.modbus) {
    const double cycle_s = modbus_exchange_s(config.modbus->address, config.modbus->timing, info);
    return {
        {to_string(config.modbus->address), cycle_s * info.sample_rate_hz, cycle_s, 1.0 / cycle_s}};
  }
  return {};
}

std::string to_string(const LinkLoad& load) {
  return fmt::format("{}: {:.3g} % ({:.3g} ms per sample; at most {:.4g} Hz)", load.link,
                     100.0 * load.load, 1e3 * load.cycle_s, load.most_hz);
}

}  // namespace stageid
