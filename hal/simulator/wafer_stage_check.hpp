#pragma once

#include "hal/simulator/simulated_stage.hpp"

namespace stageid {

/// Checks everything that wafer_stage_modes() and SimulatedStage rely on.
/// @throws std::invalid_argument naming the field, its value, and what is allowed.
void require_valid(const WaferStageSpec& spec);

}  // namespace stageid
