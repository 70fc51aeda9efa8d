#pragma once

#include <string>

#include "hal/can/can_layout.hpp"
#include "hal/stage/limits.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// The messages of a stage as a C header for its node: channels, limits, scaling, fingerprint, and structures of fixed
/// layout without pointers, unions and bit fields, which tools such as Simulink can import.
std::string can_c_header(const CanLayout& layout, const StageInfo& info, const StageLimits& limits);

}  // namespace stageid
