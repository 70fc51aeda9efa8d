#pragma once

#include <string>

#include "hal/can/can_layout.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// The frame layout of a stage as a CAN database (DBC) for bus analyzers: header, all channels in SI units,
/// commands, states. Transfers have a name only.
std::string can_dbc(const CanLayout& layout, const StageInfo& info);

}  // namespace stageid
