#pragma once

#include <utility>
#include <vector>

#include "excitation/plan/experiment_plan.hpp"

namespace stageid::test {

inline constexpr int kPlanPeriod = 100;

/// Runs of one transient period and `periods` more, at 1 kHz. The axes have another order than the actuators.
inline ExperimentPlan small_plan(int realizations = 2, int periods = 2,
                                 std::vector<ExcitationAxis> axes = {{"u3", 1.0, {}},
                                                                     {"u1", 0.5, {}}}) {
  ExperimentSpec spec;
  spec.axes = std::move(axes);
  spec.realizations = realizations;
  spec.periods = periods;
  spec.transient_periods = 1;
  spec.seed = 17;
  return {FrequencyGrid::band(1000.0, kPlanPeriod, {.low_hz = 10.0, .high_hz = 400.0}), spec};
}

}  // namespace stageid::test
