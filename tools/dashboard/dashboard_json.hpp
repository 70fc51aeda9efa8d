#pragma once

#include <optional>
#include <string>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "hal/stage/supervisor.hpp"
#include "tools/dashboard/live_levels.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

/// What changes while an experiment is measured; the page's script is the reader.
struct DashboardState {
  const char* state = "starting";  ///< starting, running, stopping, estimating, ended
  ExperimentProgress progress;
  int runs_before = 0;      ///< complete in the log already
  double wall_s = 0.0;      ///< since the first cycle
  LiveLevels::Ended ended;  ///< runs that are over
  Levels levels;
  std::string response_status;
  std::uint64_t response_edition = 0;
  std::optional<PlantSnapshot> plant;  ///< what stands around the stage
  std::vector<std::string> events;     ///< JSON objects, oldest first
  int watchers = 0;
  std::optional<int> exit_code;  ///< once it has ended
  std::string message;
};

/// One line of JSON.
std::string dashboard_state_json(const DashboardState& state);

/// What stays the same: names, units, limits, periods. Safe inside <script>.
std::string dashboard_content_json(const ExperimentConfig& config, const ExperimentPlan& plan,
                                   const StageInfo& stage);

}  // namespace stageid
