#pragma once

#include <string>
#include <vector>

#include "acquisition/prediction/limited_excitation.hpp"
#include "excitation/plan/limited_design.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// Multisines within the limits of the stage file, and the data of their design.
struct LimitedPlan {
  LimitedDesign design;
  BoundedLoop loop;
};

/// Designs the excitation of an experiment file with level.limits from its prior.
/// @pre config.limits
/// @throws FileError if the prior does not exist; FormatError if the prior or the request is unsuitable.
LimitedPlan make_limited_plan(const ExperimentConfig& config);

/// The signals relative to their limits, and the predicted accuracy; `accuracy` 0: no requested accuracy.
std::vector<std::string> limited_table(const LimitedPlan& limited, double accuracy);
Json limited_json(const LimitedPlan& limited, double accuracy);

}  // namespace stageid
