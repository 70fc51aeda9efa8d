#pragma once

#include "hal/stage/limits.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// A stage on any back end: its channels and rate, its limits, and the controller that closes its loop.
struct StageSpec {
  StageInfo info;
  StageLimits limits;
  MotionControllerSpec controller;
};

}  // namespace stageid
