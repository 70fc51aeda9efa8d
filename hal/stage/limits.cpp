#include "hal/stage/limits.hpp"

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
    case LimitKind::sensor_jump:
      return "sensor jump";
    case LimitKind::deviation:
      return "deviation";
    case LimitKind::contradiction:
      return "contradiction";
    case LimitKind::speed:
      return "speed";
    case LimitKind::stopping_distance:
      return "stopping distance";
    case LimitKind::hard_position:
      return "hard position";
  }
  return "unknown limit";
}

}  // namespace stageid
