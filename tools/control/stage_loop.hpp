#pragma once

#include "estimation/loop/loop_transfer.hpp"
#include "hal/stage/stage_spec.hpp"

namespace stageid {

/// The controller of a stage for the channels of a model. Its loops are the closed axes, or the actuators of a controller
/// given by matrices or transfer functions. An axis without a sensor or without an actuator in the model is omitted.
/// @throws std::invalid_argument if the controller is unknown or open, runs at another sample rate, or uses channels
/// that the model does not have
LoopController stage_loop(const StageSpec& stage, const AdditiveModel& model);

}  // namespace stageid
