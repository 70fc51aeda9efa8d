#pragma once

#include <vector>

#include "excitation/plan/experiment_plan.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// Index into `stage.actuators` of every axis of the plan, in the plan's order.
/// @throws std::invalid_argument if an axis is no actuator of the stage.
std::vector<int> excited_actuators(const ExperimentPlan& plan, const StageInfo& stage);

}  // namespace stageid
