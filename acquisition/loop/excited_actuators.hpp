#pragma once

#include <vector>

#include "excitation/plan/experiment_plan.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// Index into `stage.actuators` of every axis, in the order of the experiment.
/// @throws std::invalid_argument naming an axis that is not an actuator of the stage.
std::vector<int> excited_actuators(const ExperimentSpec& experiment, const StageInfo& stage);

}  // namespace stageid
