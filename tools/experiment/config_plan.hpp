#pragma once

#include <filesystem>

#include "excitation/plan/experiment_plan.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

/// The plan; drawing its multisines may take a second when crest factors are reduced, and minutes when
/// they are designed within limits. @throws as make_limited_plan()
ExperimentPlan make_plan(const ExperimentConfig& config);

/// The plan that `stageid design` wrote for this experiment.
/// @throws FileError; FormatError if the file is no plan or one of another experiment.
ExperimentPlan read_plan_of(const ExperimentConfig& config, const std::filesystem::path& file);

/// The plan with random phases and, where the level is still to be designed, of 1: for its runs, lines and
/// duration.
ExperimentPlan outline_plan(const ExperimentConfig& config);

}  // namespace stageid
