#pragma once

#include <optional>
#include <string>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "hal/stage/supervisor.hpp"
#include "tools/dashboard/live_levels.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

/// State that changes during a measurement, read by the script of the page.
struct DashboardState {
  const char* state = "starting";  ///< starting, running, stopping, estimating, ended
  ExperimentProgress progress;
  int runs_before = 0;      ///< already complete in the log
  double wall_s = 0.0;      ///< since the first cycle
  LiveLevels::Ended ended;  ///< completed runs
  Levels levels;
  std::string response_status;
  std::uint64_t response_edition = 0;
  std::optional<PlantSnapshot> plant;  ///< of the plant around the stage
  std::vector<std::string> events;     ///< JSON objects, oldest first
  int watchers = 0;
  std::optional<int> exit_code;  ///< set at the end
  std::string message;
};

/// One line of JSON.
std::string dashboard_state_json(const DashboardState& state);

/// Constant content: names, units, limits, periods. Safe inside <script>.
std::string dashboard_content_json(const ExperimentConfig& config, const ExperimentPlan& plan,
                                   const StageInfo& stage);

}  // namespace stageid
