#include "tools/measurement.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <ctime>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "acquisition/log_reader.hpp"
#include "excitation/file_error.hpp"
#include "hal/motion_controller.hpp"
#include "hal/real_time.hpp"
#include "hal/replay_stage.hpp"
#include "tools/dashboard.hpp"
#include "tools/exit_code.hpp"
#include "tools/interrupt.hpp"
#include "tools/replay_log.hpp"

namespace stageid {
namespace {

using Json = nlohmann::ordered_json;

std::string utc_now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

std::string metadata(const ExperimentConfig& config, const MeasurementRequest& request,
                     const StageInfo& stage) {
  Json json = {
      {"program", "stageid"},
      {"stageid_version", STAGEID_VERSION},
      {"started_utc", utc_now()},
      {"backend", to_string(request.backend)},
      {"measurement_id", config.measurement_id},
      {"seeds", {{"experiment", config.experiment.seed}, {"noise", config.stage.spec.seed}}},
      {"transport_delay_s", config.stage.spec.info.transport_delay_s},
      {"configuration_file", config.file.filename().string()},
      {"configuration", config.text},
      {"stage_file", config.stage.file.filename().string()},
      {"stage", config.stage.text}};
  // Virtual time has no pace, and its logs say nothing of one.
  if (stage.clock == Clock::wall) json["pace"] = stage.pace;
  return json.dump();
}

/// The runs that a log holds completely, and the check that it is the log of this experiment.
std::vector<RunId> complete_runs(const ExperimentConfig& config,
                                 const std::filesystem::path& file) {
  const std::unique_ptr<LogReader> log = open_log(file, false);
  const std::string id = measurement_id_of(log->info());
  if (!id.empty() && id != config.measurement_id)
    throw std::invalid_argument(
        fmt::format("{}: belongs to another experiment (stage, excitation or seed differ from {}); "
                    "give another -o",
                    file.string(), config.file.string()));
  std::vector<RunId> runs;
  for (const LogRun& run : log->runs())
    if (run.complete) runs.push_back({run.realization, run.experiment});
  return runs;
}

std::unique_ptr<LimitedStage> make_stage(const ExperimentConfig& config, const ExperimentPlan& plan,
                                         const MeasurementRequest& request,
                                         const std::vector<RunId>& skip) {
  WaferStageSpec spec = config.stage.spec;
  if (request.backend == Backend::sim) {
    if (request.pace >= 0.0) spec.pace = request.pace;
    spec.info.clock = spec.pace > 0.0 ? Clock::wall : Clock::virtual_time;
    return std::make_unique<LimitedStage>(std::make_unique<SimulatedStage>(spec), spec.limits);
  }
  if (request.replay.empty())
    throw std::invalid_argument("--backend replay: no log to play; add --replay LOG");
  std::vector<RunId> runs;
  for (const RunId run : plan.runs())
    if (std::find(skip.begin(), skip.end(), run) == skip.end()) runs.push_back(run);
  spec.info.backend = "replay";
  return std::make_unique<LimitedStage>(
      std::make_unique<ReplayStage>(spec.info,
                                    std::make_unique<ReplayLog>(open_log(request.replay), runs),
                                    request.replay_tolerance_n),
      spec.limits);
}

SlogWriter open_writer(const MeasurementRequest& request, const LogInfo& info, bool exists) {
  return exists ? SlogWriter::resume(request.log, info) : SlogWriter::create(request.log, info);
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

/// The replay stage also compares: what it saw is part of the result.
void judge_replay(LimitedStage& stage, MeasurementResult& result) {
  const auto* replay = dynamic_cast<const ReplayStage*>(&stage.inner());
  if (replay == nullptr || replay->mismatches() == 0) return;
  result.message += fmt::format("; {} commands differ from the recorded ones, by up to {:.3g} N",
                                replay->mismatches(), replay->largest_mismatch_n());
  if (result.exit_code == kDone) result.exit_code = kNotTrustworthy;
}

void conclude(LimitedStage& stage, MeasurementResult& result) {
  result.message = result.experiment.message;
  result.exit_code = exit_code_of(result.experiment);
  if (result.exit_code == kNotTrustworthy)
    result.message =
        fmt::format("{} samples are marked or missing",
                    result.experiment.health.marked + result.experiment.health.missing);
  judge_replay(stage, result);
}

std::unique_ptr<Dashboard> make_dashboard(const ExperimentConfig& config,
                                          const ExperimentPlan& plan,
                                          const MeasurementRequest& request,
                                          const LimitedStage& stage, int runs_before,
                                          const Console& console) {
  if (!request.dashboard) return nullptr;
  auto dashboard = std::make_unique<Dashboard>(*request.dashboard, config, plan, stage.info(),
                                               request.log, runs_before);
  console.warning("dashboard: " + dashboard->url());
  return dashboard;
}

/// Refuses what is there and must not be, or cannot be done at all.
bool check_log(const MeasurementRequest& request) {
  if (request.backend == Backend::can || request.backend == Backend::modbus)
    throw std::invalid_argument(fmt::format(
        "--backend {}: not in this version; there are sim and replay", to_string(request.backend)));
  // Killed before the first byte was written: nothing is lost by starting anew.
  std::error_code no_size;
  if (request.resume && std::filesystem::file_size(request.log, no_size) == 0 && !no_size)
    std::filesystem::remove(request.log);
  const bool exists = std::filesystem::exists(request.log);
  if (exists && !request.resume)
    throw std::invalid_argument(fmt::format(
        "{}: exists already; continue it with --resume, or remove it", request.log.string()));
  return exists;
}

/// What real time lacks here, before anything is written. @throws StageError if it is required.
void warn_of_real_time(const RealTimeOptions& options, const Console& console) {
  for (const std::string& missing : missing_for_real_time(options))
    console.warning("realtime: " + missing);
}

void tell_begin(EventLog& events, const ExperimentConfig& config, const StageInfo& stage,
                const MeasurementResult& result) {
  constexpr std::array kPolicies = {"off", "try", "require"};
  const RealTimeOptions& real_time = config.stage.real_time.options;
  events.write(result.runs_before > 0 ? "resume" : "start",
               {{"stage", stage.name},
                {"backend", stage.backend},
                {"clock", std::string(stage.clock == Clock::wall ? "wall" : "virtual")},
                {"measurement_id", config.measurement_id},
                {"runs_before", std::int64_t{result.runs_before}},
                {"runs_total", std::int64_t{result.runs_total}},
                {"realtime", std::string(kPolicies[static_cast<std::size_t>(real_time.policy)])}});
}

void tell_end(EventLog& events, const LimitedStage& stage, const MeasurementResult& result) {
  if (result.exit_code == kStoppedForSafety) {
    const LimitViolation& hit = stage.violation();
    const auto& channels = hit.of_sensor ? stage.info().sensors : stage.info().actuators;
    events.write("limit", {{"channel", channels[static_cast<std::size_t>(hit.channel)].name},
                           {"value", hit.value},
                           {"limit", hit.limit},
                           {"cycle", static_cast<std::int64_t>(hit.cycle)},
                           {"message", result.message}});
  }
  events.write("end", {{"exit_code", std::int64_t{result.exit_code}}, {"message", result.message}});
}

/// Who is told what while it is measured.
void listen(RunExperimentOptions& options, EventLog& events, Progress& progress,
            Dashboard* dashboard) {
  options.interrupt = &interrupt_flag();
  options.events = &events;
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

std::string measurement_id_of(const LogInfo& info) {
  const Json json = Json::parse(info.metadata_json, nullptr, false);
  if (!json.is_object() || !json.contains("measurement_id") || !json["measurement_id"].is_string())
    return "";
  return json["measurement_id"].get<std::string>();
}

double wall_period_s(const LogInfo& info) {
  const Json json = Json::parse(info.metadata_json, nullptr, false);
  if (!json.is_object() || !json.contains("pace") || !json["pace"].is_number()) return 0.0;
  const double pace = json["pace"].get<double>();
  return pace > 0.0 ? 1.0 / (info.sample_rate_hz * pace) : 0.0;
}

double expected_log_bytes(const ExperimentPlan& plan, const StageInfo& stage) {
  const auto words = static_cast<double>(stage.actuators.size() + stage.sensors.size() + 1);
  return static_cast<double>(plan.samples_per_run()) * static_cast<double>(plan.runs().size()) *
         words * 8.0;
}

MeasurementResult measure(const ExperimentConfig& config, const ExperimentPlan& plan,
                          const MeasurementRequest& request, const Console& console) {
  const bool exists = check_log(request);
  RunExperimentOptions options;
  if (exists) options.skip = complete_runs(config, request.log);
  MeasurementResult result;
  result.runs_total = static_cast<int>(plan.runs().size());
  result.runs_before = static_cast<int>(options.skip.size());
  const std::unique_ptr<LimitedStage> stage = make_stage(config, plan, request, options.skip);
  MotionController controller(config.stage.spec.controller);
  options.real_time = config.stage.real_time.options;
  options.misses_allowed = config.stage.real_time.misses_allowed;
  if (stage->info().clock == Clock::wall) warn_of_real_time(options.real_time, console);
  std::optional<EventLog> events;  // outlives the dashboard, whose watchers write to it
  const std::unique_ptr<Dashboard> dashboard =
      make_dashboard(config, plan, request, *stage, result.runs_before, console);
  const LogInfo info =
      experiment_log_info(plan, stage->info(), metadata(config, request, stage->info()));
  SlogWriter log = open_writer(request, info, exists);
  events.emplace(event_log_of(request.log));
  tell_begin(*events, config, stage->info(), result);

  Progress progress(console, "run", "s of stage time");
  listen(options, *events, progress, dashboard.get());
  result.experiment = run_experiment(plan, *stage, controller, log, options);
  result.seconds = progress.seconds();
  conclude(*stage, result);
  if (result.experiment.end != ExperimentEnd::log_failed)
    log.close(result.exit_code, result.message.c_str());
  tell_end(*events, *stage, result);
  if (dashboard) dashboard->finish(result.exit_code, result.message);
  if (const std::string error = events->error(); !error.empty()) console.warning(error);
  result.log_bytes = std::filesystem::file_size(request.log);
  return result;
}

}  // namespace stageid
