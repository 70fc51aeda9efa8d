#include "tools/measure/measurement.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <stop_token>
#include <thread>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/slog/slog_scan.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "hal/modbus/modbus_supervisor.hpp"
#include "hal/stage/plant_watch.hpp"
#include "hal/stage/real_time.hpp"
#include "hal/stage/real_time_checks.hpp"
#include "hal/stage/sample_clock.hpp"
#include "tools/dashboard/dashboard.hpp"
#include "tools/experiment/run_metadata.hpp"
#include "tools/measure/measured_stage.hpp"
#include "tools/measure/until_variance.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

/// The runs of a log that need not be repeated, after checking that it belongs to this experiment.
std::vector<RunId> runs_to_skip(const ExperimentConfig& config, const std::filesystem::path& file) {
  const std::unique_ptr<LogReader> log = open_log(file, false);
  const std::string id = measurement_id_of(log->info());
  if (!id.empty() && id != config.measurement_id)
    fail_request(
        "{}: belongs to another experiment (stage, excitation or seed differ from {}); choose "
        "another name with -o",
        file.string(), config.file.string());
  return runs_without_loss(*log);
}

int exit_code_of(const ExperimentResult& result) {
  switch (result.end) {
    case ExperimentEnd::complete:
      return result.health.marked + result.health.missing > 0 ? kNotTrustworthy : kDone;
    case ExperimentEnd::limit:
      return kStoppedForSafety;
    case ExperimentEnd::interrupted:
      return kInterrupted;
    case ExperimentEnd::fault:
    case ExperimentEnd::log_failed:
      break;
  }
  return kWorldFailed;
}

void conclude(const MeasuredStage& stage, const RunExperimentOptions& options,
              MeasurementResult& result) {
  result.message = result.experiment.message;
  result.exit_code = exit_code_of(result.experiment);
  const RunHealth& health = result.experiment.health;
  if (result.exit_code == kNotTrustworthy)
    result.message = fmt::format(
        "{} missing, {} marked as invalid: 'stageid log info' counts them per run, 'stageid frf' "
        "discards the periods that contain them",
        counted(health.missing, "cycle is", "cycles are"),
        counted(health.marked, "sample is", "samples are"));
  if (health.irregular > 0 && result.exit_code == kNotTrustworthy)
    result.message += fmt::format(
        "; {} the jitter limit of {:.3g} us{} ('jitter_s' in the stage file): {}, or use a node "
        "with a clock",
        counted(health.irregular, "exceeds", "exceed"),
        1e6 * (options.jitter_rms_s > 0.0 ? options.jitter_rms_s : options.jitter_s),
        options.jitter_rms_s > 0.0 ? " rms" : "",
        options.real_time.policy == RealTimePolicy::off ? "set realtime: {policy: try}"
                                                        : "use a real-time kernel");
  stage.explain(result);
}

/// The plant around the stage, operated and monitored during the lifetime of this object.
struct SupervisedPlant {
  /// @throws StageError if it does not start.
  SupervisedPlant(const SupervisorConfig& config, bool reset_fault)
      : supervisor(config.link.address, config.link.timing, config.options),
        watch(supervisor, config.conditions, reset_fault) {}

  ModbusSupervisor supervisor;
  PlantWatch watch;
};

/// Starts the plant around the stage, if the stage file describes one, and lets it end the experiment. In a replay
/// there is no plant.
std::unique_ptr<SupervisedPlant> supervise(const ExperimentConfig& config,
                                           const MeasurementRequest& request,
                                           RunExperimentOptions& options) {
  const std::optional<SupervisorConfig>& supervisor = config.stage.supervisor;
  if (!supervisor || request.backend == Backend::replay) return nullptr;
  auto plant = std::make_unique<SupervisedPlant>(*supervisor, request.reset_fault);
  options.plant_tripped = &plant->watch.tripped();
  options.plant_reason = [&watch = plant->watch] { return watch.reason(); };
  return plant;
}

std::shared_ptr<Dashboard> make_dashboard(const ExperimentConfig& config,
                                          const ExperimentPlan& plan,
                                          const MeasurementRequest& request, const StageInfo& stage,
                                          int runs_before, const Console& console) {
  if (!request.dashboard) return nullptr;
  auto dashboard = std::make_shared<Dashboard>(*request.dashboard, config, plan, stage, request.log,
                                               runs_before, request.until);
  console.warning("dashboard: " + dashboard->url());
  return dashboard;
}

/// Rejects a log that must not exist. @returns whether there is a log to continue.
bool check_log(const MeasurementRequest& request) {
  bool exists = std::filesystem::exists(request.log);
  if (exists && request.resume && is_unwritten_slog(request.log)) {
    std::filesystem::remove(request.log);
    exists = false;
  }
  if (exists && !request.resume)
    fail_request("{}: already exists; continue it with --resume, or remove it",
                 request.log.string());
  return exists;
}

/// Warns of missing real-time capabilities and of settings that delay the loop, before anything is written.
/// @throws StageError if they are required.
void warn_of_real_time(const RealTimeOptions& options, const Console& console) {
  for (const std::string& missing : missing_for_real_time(options))
    console.warning("realtime: " + missing);
  if (options.policy == RealTimePolicy::off) return;
  for (const std::string& obstacle : real_time_obstacles(options.cpu))
    console.warning("realtime: " + obstacle);
}

/// A single sample may be late if the run is regular: the response is an average over the run.
void limit_jitter(const ExperimentConfig& config, const ExperimentPlan& plan, double sample_rate_hz,
                  RunExperimentOptions& options) {
  options.jitter_s = config.stage.real_time.jitter_s;
  if (options.jitter_s > 0.0) return;
  options.jitter_s = 0.5 / sample_rate_hz;
  options.jitter_rms_s = tolerable_jitter_s(plan.grid().frequency_hz().maxCoeff());
}

void tell_begin(EventLog& events, const ExperimentConfig& config, const StageInfo& stage,
                const MeasurementResult& result) {
  const RealTimeOptions& real_time = config.stage.real_time.options;
  events.write(result.runs_before > 0 ? "resume" : "start",
               {{"stage", stage.name},
                {"backend", stage.backend},
                {"clock", std::string(to_string(stage.clock))},
                {"measurement_id", config.measurement_id},
                {"runs_before", std::int64_t{result.runs_before}},
                {"runs_total", std::int64_t{result.runs_total}},
                {"between_runs", std::string(to_string(config.stage.between_runs))},
                {"realtime", std::string(to_string(real_time.policy))}});
}

void tell_end(EventLog& events, const MeasuredStage& stage, const MeasurementResult& result) {
  const LimitViolation hit = stage.violation();
  if (result.exit_code == kStoppedForSafety && hit.kind != LimitKind::none) {
    const auto& channels = hit.of_sensor ? stage.info().sensors : stage.info().actuators;
    events.write("limit", {{"channel", channels[hit.channel].name},
                           {"value", hit.value},
                           {"limit", hit.limit},
                           {"cycle", static_cast<std::int64_t>(hit.cycle)},
                           {"message", result.message}});
  }
  events.write("end", {{"exit_code", std::int64_t{result.exit_code}}, {"message", result.message}});
}

/// Adds the final variance, for a plan that ended before the requested one was reached, too.
void tell_reached(UntilVariance& until, MeasurementResult& result, const Console& console) {
  const std::string reason = until.enough();
  if (reason.empty() && until.reached())
    result.message +=
        fmt::format("; the plan ended with a mean relative variance of {:.3g}", *until.reached());
  else if (!reason.empty() && result.message.find(reason) == std::string::npos)
    result.message += "; " + reason;
  if (!until.failure().empty()) console.warning("--until: " + until.failure());
  result.variance = until.reached();
}

/// Watches a stage while it is measured, from the log only, in a thread of lowest priority. A failure ends the watch, not
/// the measurement.
class LiveWatch {
 public:
  /// Starts to follow the log. @param watch must outlive *this
  LiveWatch(StageWatch& watch, std::filesystem::path log)
      : thread_([this, &watch, log = std::move(log)](const std::stop_token& stop) {
          constexpr int kLowest = 19;
          ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kLowest);
          try {
            watch.run(log, true,
                      [&](double) { return !stop.stop_requested() && !interrupt_flag(); });
            failure_ = watch.doubt();
          } catch (const std::exception& error) {  // errors must not affect the measurement
            failure_ = error.what();
          }
        }) {}

  /// To be called when nothing more is written. Returns when all of a closed log was watched, or after an interrupt.
  /// @returns why the watch failed; empty if it did not
  std::string finish(bool log_is_closed) {
    if (!log_is_closed) thread_.request_stop();
    if (thread_.joinable()) thread_.join();
    return failure_;
  }

 private:
  std::string failure_;
  std::jthread thread_;  // last: it uses all other members
};

/// Waits for the watch to reach the end of the log. Its failures are warnings.
void conclude_watch(const StageWatch& watch, LiveWatch& live, MeasurementResult& result,
                    const Console& console) {
  const std::string failure = live.finish(!result.experiment.log_failed);
  if (!failure.empty()) console.warning("--watch: " + failure);
  result.watch_summary = watch.summary();
  result.watch = watch.json();
  if (!watch.stage_changed() || result.exit_code != kDone) return;
  result.exit_code = kNotTrustworthy;
  result.message = "the stage has changed, so the model no longer describes it";
}

/// Closes the log if it can be written. A failure does not hide why the stage was stopped.
void close_log(SlogWriter& log, MeasurementResult& result) {
  if (result.experiment.log_failed) return;
  try {
    log.close(result.exit_code, result.message.c_str());
  } catch (const FileError& error) {
    result.experiment.take_log_failure(error.what());
    result.message += fmt::format("; {}", error.what());
    if (result.exit_code != kStoppedForSafety) result.exit_code = kWorldFailed;
  }
}

/// Connects observers of the measurement.
void listen(RunExperimentOptions& options, const std::shared_ptr<EventLog>& events,
            Progress& progress, Dashboard* dashboard) {
  options.interrupt = &interrupt_flag();
  options.events = events.get();
  options.progress = [&progress, dashboard](const ExperimentProgress& p) {
    progress.update(p.seconds_done, p.seconds_total,
                    fmt::format("run {}/{}", p.runs_done + 1, p.runs_total));
    if (dashboard != nullptr) dashboard->update(p);
  };
  if (dashboard == nullptr) return;
  options.observers = dashboard->observers();
  dashboard->watch(events);
}

}  // namespace

std::string advice_behind(const MeasurementResult& result) {
  if (result.exit_code == kInterrupted || result.exit_code == kWorldFailed)
    return "; continue with --resume";
  if (result.exit_code == kStoppedForSafety)
    return "; resuming would stop the same run again: lower the level, or check the controller and "
           "the limits";
  return "";
}

double expected_log_bytes(const ExperimentPlan& plan, const StageInfo& stage) {
  const auto words =
      static_cast<double>(stage.actuators.size() + stage.sensors.size() + (stage.stamps ? 2 : 1));
  return static_cast<double>(plan.samples_per_run()) * static_cast<double>(plan.runs().size()) *
         words * 8.0;
}

MeasurementResult measure(const ExperimentConfig& config, const ExperimentPlan& plan,
                          const MeasurementRequest& request, const Console& console) {
  const bool exists = check_log(request);
  RunExperimentOptions options;
  if (exists) options.skip = runs_to_skip(config, request.log);
  const auto watch =
      request.watch ? std::make_shared<StageWatch>(*request.watch, console) : nullptr;
  MeasurementResult result;
  result.runs_total = static_cast<int>(plan.runs().size());
  result.runs_before = static_cast<int>(options.skip.size());
  const ControlledStop stops_in_order;
  const std::unique_ptr<MeasuredStage> stage =
      make_measured_stage(config, plan, request, options.skip);
  const StageInfo& info = stage->info();
  options.real_time = config.stage.real_time.options;
  options.misses_allowed = config.stage.real_time.misses_allowed;
  limit_jitter(config, plan, info.sample_rate_hz, options);
  options.ramp_s = config.stage.ramp_s;
  // A recorded run ends with the run.
  if (request.backend != Backend::replay) options.between_runs = config.stage.between_runs;
  if (info.clock == Clock::wall) warn_of_real_time(options.real_time, console);
  if (const std::string why = never_enough(plan.spec(), config.frf); request.until && !why.empty())
    console.warning("--until: " + why);
  const std::unique_ptr<SupervisedPlant> plant = supervise(config, request, options);
  const std::shared_ptr<Dashboard> dashboard =
      make_dashboard(config, plan, request, info, result.runs_before, console);
  if (dashboard && plant) dashboard->watch([&plant] { return plant->supervisor.snapshot(); });
  if (dashboard && watch) dashboard->watch(watch);
  const LogInfo log_info =
      experiment_log_info(plan, info, run_metadata(config, request.backend, info));
  SlogWriter log = exists ? SlogWriter::resume(request.log, log_info)
                          : SlogWriter::create(request.log, log_info);
  const auto events = std::make_shared<EventLog>(event_log_of(request.log));
  tell_begin(*events, config, info, result);

  std::optional<UntilVariance> until;
  if (request.until) {
    until.emplace(request.log, config.frf, *request.until);
    options.enough = [&until] { return until->enough(); };
  }
  std::optional<LiveWatch> live_watch;
  if (watch) {
    watch->write_events(*events);
    live_watch.emplace(*watch, request.log);
  }
  Progress progress(console, "run", "s of stage time");
  listen(options, events, progress, dashboard.get());
  result.experiment = stage->perform(log, options);
  result.seconds = progress.seconds();
  conclude(*stage, options, result);
  if (until && result.experiment.end == ExperimentEnd::complete)
    tell_reached(*until, result, console);
  close_log(log, result);
  if (watch) conclude_watch(*watch, *live_watch, result, console);
  tell_end(*events, *stage, result);
  if (dashboard) {
    dashboard->finish(result.exit_code, result.message);
    result.show_end = [dashboard, &console] { dashboard->stay(console); };
  }
  if (const std::string error = events->error(); !error.empty()) console.warning(error);
  std::error_code no_log;  // a removed log has already been reported as an error
  const std::uintmax_t bytes = std::filesystem::file_size(request.log, no_log);
  if (!no_log) result.log_bytes = bytes;
  return result;
}

}  // namespace stageid
