#pragma once

/// Modal models from frequency responses: fit, validation, mode shapes, state space, loop with a controller.

#include "estimation/loop/loop_view.hpp"
#include "estimation/modal/modal_assurance.hpp"
#include "estimation/modal/mode_shapes.hpp"
#include "estimation/modal/prediction_error.hpp"
#include "estimation/modal/sampled_state_space.hpp"
#include "estimation/modal/state_space.hpp"
#include "estimation/modal/validation.hpp"
#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "estimation/request/fit_request.hpp"
#include "frf/frf.hpp"

namespace stageid {

using Fit = FitResult;

}  // namespace stageid
