#pragma once

#include "hal/simulator/simulated_stage.hpp"

namespace stageid {

/// Checks all assumptions of wafer_stage_modes() and SimulatedStage.
/// @throws std::invalid_argument naming the field, its value, and the permitted values.
void require_valid(const WaferStageSpec& spec);

}  // namespace stageid
