#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "acquisition/slog_writer.hpp"
#include "excitation/experiment_plan.hpp"
#include "hal/limited_stage.hpp"
#include "hal/motion_controller.hpp"

namespace stageid {

struct ExperimentProgress {
  RunId run;
  int runs_done = 0;
  int runs_total = 0;
  double seconds_done = 0.0;  ///< of stage time, over the whole experiment
  double seconds_total = 0.0;
  RunHealth health;  ///< of the current run
};

struct RunExperimentOptions {
  std::vector<RunId> skip;  ///< complete in the log already (--resume)
  const std::atomic<bool>* interrupt =
      nullptr;              ///< set by a signal handler: controlled stop, log kept
  double ramp_s = 0.1;      ///< excitation is ramped to zero over this before stopping
  int misses_allowed = 10;  ///< leaky bucket: +2 a miss, -1 a good cycle, above: stop
  std::function<void(const ExperimentProgress&)>
      progress;  ///< from the calling thread, a few times a second
};

enum class ExperimentEnd : std::uint8_t { complete, limit, fault, interrupted, log_failed };

struct ExperimentResult {
  ExperimentEnd end = ExperimentEnd::complete;
  std::string message = "run_experiment was not called";
  RunHealth health;  ///< over all runs
  int runs_done = 0;
};

/// Performs every run of the plan on the stage: u = r + C(y), every sample logged.
///
/// The calling thread is the loop; a thread of its own empties the ring into the log. In virtual
/// time the loop waits for the log, against the wall clock a full ring ends the experiment
/// (log_failed). A limit, a fault, too many misses or an interrupt ends the current run in a
/// controlled stop: the excitation is ramped down in closed loop, the stage stopped, the run logged
/// as incomplete. Every run starts from standstill with the seed of (plan seed, realization,
/// experiment), so that a repeated or resumed run is the same run.
/// @throws StageError, FileError, std::invalid_argument if plan and stage do not fit.
ExperimentResult run_experiment(const ExperimentPlan& plan, LimitedStage& stage,
                                MotionController& controller, SlogWriter& log,
                                const RunExperimentOptions& options = {});

}  // namespace stageid
