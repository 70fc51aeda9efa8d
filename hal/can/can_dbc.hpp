#pragma once

#include <string>

#include "hal/can/can_layout.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// The layout of a stage's frames as a CAN database (DBC), for programs that show traffic in words:
/// header, every channel in SI units, commands, states. Transfers are named only.
std::string can_dbc(const CanLayout& layout, const StageInfo& info);

}  // namespace stageid
