#pragma once

#include <string>

#include "acquisition/record/log_info.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

/// Provenance of a log: program, configuration, stage, seeds, measurement id; JSON.
std::string run_metadata(const ExperimentConfig& config, Backend backend, const StageInfo& stage);

/// The period of the loop by wall clock; 0 if the log was measured in virtual time, or if unknown.
double wall_period_s(const LogInfo& info);

/// Measurement id in the metadata of the log; empty if there is none.
std::string measurement_id_of(const LogInfo& info);

}  // namespace stageid
