#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/record/log_reader.hpp"
#include "tools/dashboard/dashboard_address.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/json.hpp"
#include "tools/watch/stage_watch.hpp"

namespace stageid {

/// Options of `run`.
struct MeasurementRequest {
  std::filesystem::path log;
  Backend backend = Backend::sim;
  std::filesystem::path replay;  ///< backend replay: the recorded log
  double replay_tolerance_n = 1e-9;
  bool resume = false;
  double pace = -1.0;        ///< < 0: that of the stage file
  bool reset_fault = false;  ///< clear a fault of the node or plant first
  std::optional<DashboardAddress> dashboard = {};
  std::optional<double> until = {};  ///< target of the mean relative variance
  std::optional<WatchOptions> watch = {};
};

struct MeasurementResult {
  ExperimentResult experiment;
  int runs_total = 0;
  int runs_before = 0;  ///< already complete in the log
  int exit_code = 0;    ///< kDone, kWorldFailed, kNotTrustworthy, kStoppedForSafety or kInterrupted
  std::string message;  ///< one line, the reason of the end
  std::optional<double> variance = {};  ///< mean relative, of the last estimate; with `until` only
  std::string watch_summary = {};       ///< one line; empty: not watched
  Json watch = {};                      ///< changes and tracked properties
  double seconds = 0.0;
  std::uint64_t log_bytes = 0;
  std::function<void()> show_end = [] {};  ///< on the dashboard, until its pages are closed
};

/// Performs the experiment and logs it. When a log is resumed, its complete runs are skipped, unless recovery
/// has lost rows of them.
/// @throws std::invalid_argument if the log exists and must not be resumed, or belongs to another experiment. @throws
/// FileError, FormatError, StageError
MeasurementResult measure(const ExperimentConfig& config, const ExperimentPlan& plan,
                          const MeasurementRequest& request, const Console& console);

/// Remedy for a measurement that ended early, to be appended to its message. Resuming helps after a lost link or an
/// interrupt, but not if the same run would reach the same limit.
std::string advice_behind(const MeasurementResult& result);

/// Size of the samples of a whole experiment in a native log, in bytes.
double expected_log_bytes(const ExperimentPlan& plan, const StageInfo& stage);

}  // namespace stageid
