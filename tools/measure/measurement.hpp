#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "acquisition/loop/run_experiment.hpp"
#include "tools/dashboard/dashboard_address.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// How `run` is asked to measure.
struct MeasurementRequest {
  std::filesystem::path log;
  Backend backend = Backend::sim;
  std::filesystem::path replay;  ///< backend replay: the log that is played
  double replay_tolerance_n = 1e-9;
  bool resume = false;
  double pace = -1.0;        ///< < 0: as the stage file says
  bool reset_fault = false;  ///< clear a fault of the node or plant first
  std::optional<DashboardAddress> dashboard = {};
  std::optional<double> until = {};  ///< mean relative variance that is enough
};

struct MeasurementResult {
  ExperimentResult experiment;
  int runs_total = 0;
  int runs_before = 0;  ///< complete in the log already
  int exit_code = 0;    ///< kDone, kWorldFailed, kNotTrustworthy, kStoppedForSafety or kInterrupted
  std::string message;  ///< one line, why it ended
  std::optional<double> variance = {};  ///< mean relative, at the last look; with `until` only
  double seconds = 0.0;
  std::uint64_t log_bytes = 0;
};

/// Performs the experiment and logs it. Complete runs of a log that is resumed are not repeated.
/// @throws std::invalid_argument if the log exists and must not be resumed, or belongs to another
/// experiment. @throws FileError, FormatError, StageError
MeasurementResult measure(const ExperimentConfig& config, const ExperimentPlan& plan,
                          const MeasurementRequest& request, const Console& console);

/// What to do about a measurement that ended early, behind its message: resuming helps where the link was lost or
/// somebody interrupted, not where the same run would hit the same limit.
std::string advice_behind(const MeasurementResult& result);

/// Bytes of the samples of a whole experiment in a native log.
double expected_log_bytes(const ExperimentPlan& plan, const StageInfo& stage);

}  // namespace stageid
