#pragma once

/// Random-phase multisines and the experiments that use them.

#include "excitation/multisine/multisine.hpp"
#include "excitation/multisine/signal_peaks.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "excitation/plan/limited_design.hpp"
