#include "hal/limits.hpp"

namespace stageid {

const char* to_string(LimitKind kind) noexcept {
  switch (kind) {
    case LimitKind::none:
      return "none";
    case LimitKind::actuator:
      return "actuator";
    case LimitKind::slew:
      return "slew";
    case LimitKind::thermal_rms:
      return "thermal rms";
    case LimitKind::position:
      return "position";
    case LimitKind::not_finite:
      return "not finite";
    case LimitKind::stuck_sensor:
      return "stuck sensor";
  }
  return "unknown limit";
}

}  // namespace stageid
