#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "acquisition/loop/run_observer.hpp"
#include "acquisition/record/event_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "acquisition/record/run_writer.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "hal/stage/limited_stage.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/real_time.hpp"

namespace stageid {

/// Progress of an experiment, without skipped runs.
struct ExperimentProgress {
  RunId run;
  int runs_done = 0;
  int runs_total = 0;
  double seconds_done = 0.0;  ///< of stage time
  double seconds_total = 0.0;
  RunHealth health;                             ///< of the current run
  RunTiming timing;                             ///< of the current run; empty in virtual time
  NodeState node_state = NodeState::not_ready;  ///< the last reported state
};

struct RunExperimentOptions {
  std::vector<RunId> skip = {};  ///< complete in the log already (--resume)
  /// Set by a signal handler: controlled stop, the log is kept.
  const std::atomic<bool>* interrupt = nullptr;
  /// Set when a condition of the plant is violated: controlled stop, `fault`.
  const std::atomic<bool>* plant_tripped = nullptr;
  std::function<std::string()> plant_reason = {};  ///< called after the stage is stopped
  /// Called between realizations, with all data in the log and the stage at a standstill. A nonempty reason ends
  /// the experiment as complete.
  std::function<std::string()> enough = {};
  double ramp_s = 0.1;    ///< duration of the ramp of the excitation to zero before stopping
  double jitter_s = 0.0;  ///< see LoopOptions
  double jitter_rms_s = 0.0;
  int misses_allowed = 10;  ///< leaky bucket: +2 per bad cycle, -1 per good one; above this: stop
  /// hold: the loop remains closed from the first run to the last. In virtual time no time passes between runs.
  BetweenRuns between_runs = BetweenRuns::release;
  RealTimeOptions real_time = {};            ///< of the loop's thread; ignored in virtual time
  EventLog* events = nullptr;                ///< receives runs, misses, states, limits and stops
  std::vector<RunObserver*> observers = {};  ///< receive every row, in the log's thread
  /// Called from the calling thread a few times per second and once at the end. An exception ends the experiment
  /// in a controlled stop and is rethrown.
  std::function<void(const ExperimentProgress&)> progress = {};

  bool interrupted() const noexcept;
  bool tripped() const noexcept;
  std::string trip_reason() const;
};

enum class ExperimentEnd : std::uint8_t { complete, limit, fault, interrupted, log_failed };

struct ExperimentResult {
  ExperimentEnd end = ExperimentEnd::complete;
  std::string message = "run_experiment was not called";
  RunHealth health;         ///< over all runs
  RunTiming timing;         ///< over all runs
  int runs_done = 0;        ///< number of complete runs, without skipped ones
  bool log_failed = false;  ///< rows are missing from the log: do not close it

  /// The reason for stopping the stage has priority over a failure of the log.
  void take_log_failure(const std::string& error);
};

/// Description of a log of this plan on this stage. Its excitation channels are the plan's axes, in the plan's
/// order. @throws std::invalid_argument if the stage lacks an axis or has another rate.
LogInfo experiment_log_info(const ExperimentPlan& plan, const StageInfo& stage,
                            std::string metadata_json = "{}");

/// The runs of a log for RunExperimentOptions::skip: recorded to their end, and nothing of them lost in recovery.
std::vector<RunId> runs_without_loss(const LogReader& log);

/// Seed of one run for CyclicStage::start(): with splitmix64's finalizer m and its increment g,
///   m(m(m(plan_seed + g) + g (realization + 1)) + g (experiment + 1)).
/// Source: Steele, Lea and Flood, Fast splittable pseudorandom number generators (2014).
std::uint64_t run_seed(std::uint64_t plan_seed, RunId run) noexcept;

/// Performs every run of the plan on the stage: u = r + C(y), every sample is logged.
///
/// One thread runs the loop, another writes the ring to the log, and the calling thread reports. In virtual time
/// the loop waits for the log; on the wall clock, a full ring ends the experiment (log_failed).
///
/// A limit, a fault, too many misses, the plant or an interrupt ends the current run in a controlled stop: the
/// excitation is ramped down in closed loop, the stage is stopped, and the run is logged as incomplete. A run that
/// does not start also ends the experiment with a fault. Every run starts from standstill with the seed of
/// (plan seed, realization, experiment), so that a repeated or resumed run is identical. If the stage is held between
/// the runs, only the first one starts so, and between the runs there are the same reasons to stop.
/// @throws StageError if real time is required but unavailable.
/// @throws std::invalid_argument if plan, stage, controller and log do not fit.
ExperimentResult run_experiment(const ExperimentPlan& plan, LimitedStage& stage,
                                MotionController& controller, RunWriter& log,
                                const RunExperimentOptions& options = {});

}  // namespace stageid
