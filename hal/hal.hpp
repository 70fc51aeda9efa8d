#pragma once

/// Stages: the hardware interface, its limits, the simulator.

#include "hal/plugin/plugin_stage.hpp"
#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/limited_stage.hpp"
#include "hal/stage/replay_stage.hpp"
#include "hal/stage/resident_stage.hpp"
#include "hal/stage/stage.hpp"
#include "hal/stage/supervisor.hpp"
