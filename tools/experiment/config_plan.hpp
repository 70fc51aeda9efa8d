#pragma once

#include <filesystem>

#include "excitation/plan/experiment_plan.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

/// The excited lines.
FrequencyGrid grid_of(const ExperimentConfig& config);

/// Creates the plan. Takes a second if crest factors are reduced, and minutes if the multisines are designed within
/// limits. @throws as make_limited_plan()
ExperimentPlan make_plan(const ExperimentConfig& config);

/// The plan that `stageid design` wrote for this experiment.
/// @throws FileError; FormatError if the file is not a plan, or the plan of another experiment.
ExperimentPlan read_plan_of(const ExperimentConfig& config, const std::filesystem::path& file);

/// The plan with random phases and, if the level is not designed yet, level 1: for its runs, lines and duration.
ExperimentPlan outline_plan(const ExperimentConfig& config);

}  // namespace stageid
