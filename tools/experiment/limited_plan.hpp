#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "acquisition/prediction/limited_excitation.hpp"
#include "excitation/plan/limited_design.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

/// Multisines within the limits of the stage file, and what they were designed with.
struct LimitedPlan {
  LimitedDesign design;
  BoundedLoop loop;
};

/// Designs the excitation of an experiment file with level.limits from its prior.
/// @pre config.limits
/// @throws FileError if the prior is not there; FormatError if it, or what is asked of it, does not fit.
LimitedPlan make_limited_plan(const ExperimentConfig& config);

/// Time that reaches a mean relative variance with the plan's runs, whole realizations of them, in s.
/// @throws std::invalid_argument unless `variance` is positive and finite.
double duration_to_reach_s(const LimitedPlan& limited, double variance);

/// Mean relative variance after all runs of the plan.
double final_variance(const LimitedPlan& limited);

/// The signals against their limits, and what accuracy is to be expected; `accuracy` 0: none is wanted.
std::vector<std::string> limited_table(const LimitedPlan& limited, double accuracy);
nlohmann::ordered_json limited_json(const LimitedPlan& limited, double accuracy);

}  // namespace stageid
