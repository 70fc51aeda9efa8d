#pragma once

#include <filesystem>

#include "excitation/plan/experiment_plan.hpp"

namespace stageid {

/// Writes / reads excitation.h5 (docs/formats.md).
/// @throws FileError, FormatError
void write_experiment_plan(const std::filesystem::path& file, const ExperimentPlan& plan);
ExperimentPlan read_experiment_plan(const std::filesystem::path& file);

}  // namespace stageid
