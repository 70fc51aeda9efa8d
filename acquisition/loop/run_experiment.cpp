#include "acquisition/loop/run_experiment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/loop/event_recorder.hpp"
#include "acquisition/loop/excited_actuators.hpp"
#include "acquisition/loop/log_thread.hpp"
#include "acquisition/loop/measurement_loop.hpp"
#include "acquisition/loop/shared_progress.hpp"
#include "acquisition/loop/side_thread.hpp"
#include "acquisition/record/utc_time.hpp"
#include "acquisition/slog/slog_index.hpp"
#include "excitation/multisine/random_stream.hpp"
#include "excitation/words/require.hpp"

namespace stageid {

namespace {

constexpr std::chrono::milliseconds kProgressEvery{200};
constexpr std::size_t kVirtualRingRows = std::size_t{1} << 16;
constexpr double kWallRingSeconds = 8.0;  // longest tolerated stall of the disk
constexpr double kPublishEvery_s = 0.1;
constexpr double kMostUnpublished = 1024.0;  // cycles

ChannelList channel_list(const std::vector<Channel>& channels) {
  ChannelList list;
  for (const Channel& channel : channels) {
    list.names.push_back(channel.name);
    list.units.push_back(channel.unit);
  }
  return list;
}

/// One experiment in progress.
class Experiment {
 public:
  Experiment(const ExperimentPlan& plan, LimitedStage& stage, MotionController& controller,
             RunWriter& log, const RunExperimentOptions& options)
      : plan_(plan),
        stage_(stage),
        options_(options),
        ring_(slog_row_words(log.info()), ring_rows(stage.info())),
        loop_(stage, controller, ring_,
              {options.ramp_s, options.jitter_s, options.jitter_rms_s, options.misses_allowed,
               options.between_runs}),
        recorder_(make_recorder(options)),
        log_(log, ring_, observers()),
        wall_(stage.info().clock == Clock::wall),
        side_(wall_ && options.between_runs == BetweenRuns::hold ? std::make_unique<SideThread>()
                                                                 : nullptr),
        actuators_(excited_actuators(plan.spec(), stage.info())),
        runs_(plan.runs_without(options.skip)) {}

  /// Runs the loop in its thread and reports progress in this one.
  ExperimentResult perform() {
    std::thread loop([this] {
      try {
        const RealTime real_time(wall_ ? options_.real_time : RealTimeOptions{});
        perform_runs();
      } catch (...) {
        failure_ = std::current_exception();
      }
      const std::lock_guard lock(mutex_);
      done_ = true;
      changed_.notify_all();
    });
    try {
      report_until_done();
    } catch (...) {  // from the progress function
      abandoned_.store(true, std::memory_order_relaxed);
      loop.join();
      throw;
    }
    loop.join();
    log_.drain();
    if (failure_) std::rethrow_exception(failure_);
    result_.runs_done = log_.complete_runs();
    if (log_.failed()) result_.take_log_failure(log_.error());
    tell_events();
    return std::move(result_);
  }

 private:
  static std::unique_ptr<EventRecorder> make_recorder(const RunExperimentOptions& options) {
    return options.events == nullptr ? nullptr : std::make_unique<EventRecorder>(*options.events);
  }

  std::vector<RunObserver*> observers() const {
    std::vector<RunObserver*> all = options_.observers;
    if (recorder_) all.push_back(recorder_.get());
    return all;
  }

  /// Forwards the loop's events. Called by the reporting thread.
  void tell_events() {
    while (const std::optional<LoopEvent> event = loop_.events().pop()) {
      if (event->kind == LoopEvent::Kind::state) node_state_ = static_cast<NodeState>(event->code);
      if (options_.events == nullptr) continue;
      const RunId run = runs_[event->run];
      const bool state = event->kind == LoopEvent::Kind::state;
      const std::string code = state ? to_string(static_cast<NodeState>(event->code))
                                     : to_string(static_cast<StopReason>(event->code));
      std::vector<EventField> fields = event_place(run.realization, run.experiment);
      fields.push_back({"cycle", static_cast<std::int64_t>(event->cycle)});
      fields.push_back({state ? "state" : "reason", code});
      options_.events->write(state ? "state" : "stop", fields);
    }
  }

  static std::size_t ring_rows(const StageInfo& info) {
    if (info.clock == Clock::virtual_time) return kVirtualRingRows;
    return std::max(kVirtualRingRows,
                    static_cast<std::size_t>(kWallRingSeconds * info.sample_rate_hz));
  }

  void perform_runs() {
    result_.end = ExperimentEnd::complete;
    std::string enough;
    int realization = -1;
    for (const RunId& run : runs_) {
      if (stopped_between_runs()) break;
      if (options_.enough && run.realization != std::exchange(realization, run.realization)) {
        meanwhile([&] {
          log_.drain();
          enough = options_.enough();
        });
        if (!enough.empty()) break;
      }
      try {
        const StopReason reason = perform_run(run);
        if (reason == StopReason::none) continue;
        finish(reason);
      } catch (const StageError& error) {  // the run does not start
        if (interrupted()) {
          finish(StopReason::interrupt);
          break;
        }
        end_with(ExperimentEnd::fault,
                 fmt::format("stage '{}': {}", stage_.info().name, error.what()));
      }
      break;
    }
    loop_.release();
    if (result_.end == ExperimentEnd::complete)
      finish(loop_.reason());  // stopped after the last run
    if (result_.end == ExperimentEnd::complete)
      result_.message = fmt::format("{}{}{} measured", enough, enough.empty() ? "" : "; ",
                                    counted(result_.runs_done, "run"));
  }

  bool stopped_between_runs() {
    const StopReason reason = interrupted()        ? StopReason::interrupt
                              : options_.tripped() ? StopReason::plant
                                                   : loop_.reason();
    finish(reason);
    return reason != StopReason::none;
  }

  StopReason perform_run(RunId id) {
    const auto started = std::chrono::steady_clock::now();
    progress_.begin(id, wall_);
    LoopExcitation excitation;
    PreparedExcitation prepared;
    LogRun run;
    run.realization = id.realization;
    run.experiment = id.experiment;
    const bool held = loop_.holding();
    meanwhile([&] {
      excitation = {plan_.excitation(id), actuators_,
                    static_cast<std::uint64_t>(plan_.samples_per_run())};
      run.started_utc = utc_now();
      if (held) prepared = loop_.prepare(excitation);
      log_.begin_run(run, excitation.period);  // before the stage moves: it allocates and locks
    });
    if (held) {
      loop_.next(prepared);  // does nothing if the loop has been stopped meanwhile
    } else {
      try {
        loop_.start(run_seed(plan_.spec().seed, id), excitation);
      } catch (...) {
        log_.forget_run();
        throw;
      }
    }
    log_.confirm_run();
    if (!held || !loop_.ended()) cycle_until_end();
    run.complete = loop_.complete() && loop_.reason() != StopReason::log;
    run.health = loop_.health();
    run.timing = loop_.timing();
    run.health.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
    const StopReason reason = loop_.reason();
    const std::int64_t held_before = std::exchange(held_cycles_, 0);
    meanwhile([&] {
      log_.end_run(run);
      if (held) tell_hold(id, held_before);
    });
    result_.health += run.health;
    result_.timing += run.timing;
    result_.runs_done += run.complete ? 1 : 0;
    progress_.publish(run.health, run.timing, wall_);
    progress_.runs_done.store(result_.runs_done, std::memory_order_relaxed);
    return reason;
  }

  /// Between the runs nothing is recorded.
  void tell_hold(RunId next, std::int64_t cycles) {
    if (options_.events == nullptr) return;
    std::vector<EventField> fields = event_place(next.realization, next.experiment);
    fields.push_back({"cycles_not_recorded", cycles});
    options_.events->write("hold", fields);
  }

  /// Does what is to be done between runs. If the stage is held on the wall clock, the loop keeps cycling.
  template <typename Work>
  void meanwhile(Work work) {
    if (!side_ || !loop_.holding()) {
      work();
      return;
    }
    side_->begin(work);
    while (!side_->done()) {
      if (loop_.holding()) {
        ++held_cycles_;
        static_cast<void>(cycle());
      } else if (loop_.step() == LoopStatus::ended) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
    side_->rethrow();
  }

  void cycle_until_end() {
    const auto publish_every = static_cast<std::uint64_t>(
        std::clamp(kPublishEvery_s * stage_.info().sample_rate_hz, 1.0, kMostUnpublished));
    std::uint64_t until_publish = publish_every;
    while (cycle()) {
      if (--until_publish == 0) {
        until_publish = publish_every;
        progress_.publish(loop_.health(), loop_.timing(), wall_);
      }
    }
  }

  /// @returns false if the run is over
  bool cycle() {
    const LoopStatus status = loop_.step();
    if (status == LoopStatus::ended) return false;
    if (status == LoopStatus::ring_full) {
      if (wall_ || log_.failed()) {
        loop_.request_stop(StopReason::log);
      } else {
        std::this_thread::yield();
      }
    }
    if (interrupted()) loop_.request_stop(StopReason::interrupt);
    if (options_.tripped()) loop_.request_stop(StopReason::plant);
    if (log_.failed()) loop_.request_stop(StopReason::log);
    return status != LoopStatus::held;
  }

  bool interrupted() const noexcept {
    return abandoned_.load(std::memory_order_relaxed) || options_.interrupted();
  }

  void end_with(ExperimentEnd end, std::string message) {
    result_.end = end;
    result_.message = std::move(message);
  }

  void finish(StopReason reason) {
    const std::string& stage = stage_.info().name;
    switch (reason) {
      case StopReason::none:
        return;
      case StopReason::limit:
        return end_with(ExperimentEnd::limit, describe_stop(stage_));
      case StopReason::fault:
        return end_with(ExperimentEnd::fault, fmt::format("stage '{}' reports: {}", stage,
                                                          to_string(loop_.last_trouble())));
      case StopReason::misses:
        return end_with(ExperimentEnd::fault,
                        fmt::format("stage '{}': too many bad cycles; the last one: {}", stage,
                                    to_string(loop_.last_trouble())));
      case StopReason::plant:
        return end_with(ExperimentEnd::fault, options_.trip_reason());
      case StopReason::interrupt:
        return end_with(ExperimentEnd::interrupted, "interrupted; the measured data are kept");
      case StopReason::log:
        return end_with(ExperimentEnd::log_failed,
                        "the log could not be written fast enough; write to a faster disk or lower "
                        "the sample rate");
    }
  }

  void report_until_done() {
    std::unique_lock lock(mutex_);
    while (!changed_.wait_for(lock, kProgressEvery, [this] { return done_; })) {
      lock.unlock();
      report();
      lock.lock();
    }
    lock.unlock();
    report();
  }

  void report() {
    tell_events();
    if (!options_.progress) return;
    ExperimentProgress progress;
    progress.node_state = node_state_;
    progress.run = {progress_.realization.load(std::memory_order_relaxed),
                    progress_.experiment.load(std::memory_order_relaxed)};
    progress.runs_done = progress_.runs_done.load(std::memory_order_relaxed);
    progress.runs_total = static_cast<int>(runs_.size());
    progress.health = progress_.health.load();
    if (wall_) progress.timing = progress_.timing.load();
    const int before = std::max(0, progress_.runs_begun.load(std::memory_order_relaxed) - 1);
    const double rate_hz = plan_.grid().sample_rate_hz();
    const double run_s = static_cast<double>(plan_.samples_per_run()) / rate_hz;
    progress.seconds_total = run_s * progress.runs_total;
    progress.seconds_done =
        std::min(progress.seconds_total,
                 run_s * before + static_cast<double>(progress.health.cycles) / rate_hz);
    options_.progress(progress);
  }

  const ExperimentPlan& plan_;
  LimitedStage& stage_;
  const RunExperimentOptions& options_;
  SampleRing ring_;
  MeasurementLoop loop_;
  std::unique_ptr<EventRecorder> recorder_;
  LogThread log_;
  bool wall_;
  std::unique_ptr<SideThread> side_;  // only if the loop keeps cycling between runs
  std::vector<int> actuators_;
  std::vector<RunId> runs_;
  std::int64_t held_cycles_ = 0;  // since the last run
  ExperimentResult result_;
  std::exception_ptr failure_;
  SharedProgress progress_;
  NodeState node_state_ = NodeState::not_ready;  // written by the reporting thread
  std::atomic<bool> abandoned_ = false;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool done_ = false;
};

}  // namespace

void ExperimentResult::take_log_failure(const std::string& error) {
  const bool stage_ended_it = end == ExperimentEnd::limit || end == ExperimentEnd::fault;
  message = stage_ended_it ? message + "; " + error : error;
  if (!stage_ended_it) end = ExperimentEnd::log_failed;
  log_failed = true;
}

LogInfo experiment_log_info(const ExperimentPlan& plan, const StageInfo& stage,
                            std::string metadata_json) {
  const double rate_hz = plan.grid().sample_rate_hz();
  if (std::abs(rate_hz - stage.sample_rate_hz) > 1e-9 * stage.sample_rate_hz)
    fail_request(
        "experiment: designed for {} Hz, but the stage runs at {} Hz; give both the same "
        "sample_rate_hz",
        rate_hz, stage.sample_rate_hz);
  if (stage.maximum_rate_hz > 0.0 && rate_hz > stage.maximum_rate_hz)
    fail_request(
        "experiment: {} Hz exceeds the stage's maximum sample rate of {} Hz; lower sample_rate_hz",
        rate_hz, stage.maximum_rate_hz);
  LogInfo info;
  info.sample_rate_hz = rate_hz;
  info.period_samples = plan.grid().samples_per_period();
  info.transient_periods = plan.spec().transient_periods;
  info.actuators = channel_list(stage.actuators);
  info.sensors = channel_list(stage.sensors);
  for (const int index : excited_actuators(plan.spec(), stage)) {
    const Channel& actuator = stage.actuators[index];
    info.excitation.names.push_back(actuator.name);
    info.excitation.units.push_back(actuator.unit);
  }
  info.stamps = stage.stamps;
  info.metadata_json = std::move(metadata_json);
  check_log_info(info);
  return info;
}

std::vector<RunId> runs_without_loss(const LogReader& log) {
  std::vector<RunId> runs;
  for (const LogRun& run : log.runs())
    if (run.complete && run.health.lost == 0) runs.push_back({run.realization, run.experiment});
  return runs;
}

bool RunExperimentOptions::interrupted() const noexcept {
  return interrupt != nullptr && interrupt->load(std::memory_order_relaxed);
}

bool RunExperimentOptions::tripped() const noexcept {
  return plant_tripped != nullptr && plant_tripped->load(std::memory_order_relaxed);
}

std::string RunExperimentOptions::trip_reason() const {
  return plant_reason ? plant_reason() : "the plant tripped";
}

std::uint64_t run_seed(std::uint64_t plan_seed, RunId run) noexcept {
  const auto step = [](int index) {
    return kSplitMix64Increment * static_cast<std::uint64_t>(index);
  };
  return splitmix64(splitmix64(splitmix64(plan_seed) + step(run.realization)) +
                    step(run.experiment));
}

ExperimentResult run_experiment(const ExperimentPlan& plan, LimitedStage& stage,
                                MotionController& controller, RunWriter& log,
                                const RunExperimentOptions& options) {
  require(same_measurement(log.info(), experiment_log_info(plan, stage.info())),
          "experiment: the log was created for a different plan or stage; create it with "
          "experiment_log_info()");
  return Experiment(plan, stage, controller, log, options).perform();
}

}  // namespace stageid
