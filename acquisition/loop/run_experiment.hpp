#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "acquisition/loop/run_observer.hpp"
#include "acquisition/record/event_log.hpp"
#include "acquisition/record/run_writer.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "hal/stage/limited_stage.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/real_time.hpp"

namespace stageid {

/// How far an experiment is. Runs that are skipped count in none of these.
struct ExperimentProgress {
  RunId run;
  int runs_done = 0;
  int runs_total = 0;
  double seconds_done = 0.0;  ///< of stage time
  double seconds_total = 0.0;
  RunHealth health;                             ///< of the current run
  RunTiming timing;                             ///< of the current run; empty in virtual time
  NodeState node_state = NodeState::not_ready;  ///< the newest that the stage told
};

struct RunExperimentOptions {
  std::vector<RunId> skip = {};  ///< complete in the log already (--resume)
  /// Set by a signal handler: controlled stop, log kept.
  const std::atomic<bool>* interrupt = nullptr;
  /// Set when something around the stage does not hold any more: controlled stop, `fault`.
  const std::atomic<bool>* plant_tripped = nullptr;
  std::function<std::string()> plant_reason = {};  ///< why; asked once the stage is stopped
  /// Asked between realizations, with all that was measured in the log, while the stage stands: why it
  /// is enough, or nothing. With a reason the experiment ends as complete.
  std::function<std::string()> enough = {};
  double ramp_s = 0.1;             ///< excitation is ramped to zero over this before stopping
  int misses_allowed = 10;         ///< leaky bucket: +2 a bad cycle, -1 a good one, above: stop
  RealTimeOptions real_time = {};  ///< of the loop's thread, where the clock is the wall's
  EventLog* events = nullptr;      ///< told of runs, misses, states, limits and stops
  std::vector<RunObserver*> observers = {};  ///< told of every row, by the log's thread
  /// From the calling thread, a few times a second and once at the end. If it throws, the experiment
  /// ends in a controlled stop and the exception goes on.
  std::function<void(const ExperimentProgress&)> progress = {};

  bool interrupted() const noexcept;
  bool tripped() const noexcept;
  std::string trip_reason() const;
};

enum class ExperimentEnd : std::uint8_t { complete, limit, fault, interrupted, log_failed };

struct ExperimentResult {
  ExperimentEnd end = ExperimentEnd::complete;
  std::string message = "run_experiment was not called";
  RunHealth health;   ///< over all runs
  RunTiming timing;   ///< over all runs
  int runs_done = 0;  ///< complete ones, without those skipped
};

/// What a log of this plan on this stage says about itself. Its excitation channels are the plan's
/// axes, in the plan's order. @throws std::invalid_argument if the stage lacks an axis or has
/// another rate.
LogInfo experiment_log_info(const ExperimentPlan& plan, const StageInfo& stage,
                            std::string metadata_json = "{}");

/// Seed of one run for CyclicStage::start(): with splitmix64's finalizer m and its increment g,
///   m(m(m(plan_seed + g) + g (realization + 1)) + g (experiment + 1)).
/// Source: Steele, Lea and Flood, Fast splittable pseudorandom number generators (2014).
std::uint64_t run_seed(std::uint64_t plan_seed, RunId run) noexcept;

/// Performs every run of the plan on the stage: u = r + C(y), every sample logged.
///
/// A thread of its own is the loop, another empties the ring into the log; the calling thread
/// reports. In virtual time the loop waits for the log, against the wall clock a full ring ends the experiment
/// (log_failed). A limit, a fault, too many misses, the plant or an interrupt ends the current run in a
/// controlled stop: the excitation is ramped down in closed loop, the stage stopped, the run logged
/// as incomplete. Every run starts from standstill with the seed of (plan seed, realization,
/// experiment), so that a repeated or resumed run is the same run.
/// A run that cannot be started ends it with a fault too. @throws StageError if real time is required
/// and not to be had.
/// @throws std::invalid_argument if plan, stage, controller and log do not fit.
ExperimentResult run_experiment(const ExperimentPlan& plan, LimitedStage& stage,
                                MotionController& controller, RunWriter& log,
                                const RunExperimentOptions& options = {});

}  // namespace stageid
