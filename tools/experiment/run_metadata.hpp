#pragma once

#include <string>

#include "acquisition/record/log_info.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

/// What a log says of its making: program, configuration, stage, seeds, measurement id; JSON.
std::string run_metadata(const ExperimentConfig& config, Backend backend, const StageInfo& stage);

/// The period of the loop on its wall clock; 0 if the log was measured in virtual time, or does not
/// say.
double wall_period_s(const LogInfo& info);

/// What the log's metadata say of the experiment it belongs to; empty if nothing.
std::string measurement_id_of(const LogInfo& info);

}  // namespace stageid
