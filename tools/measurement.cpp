#include "tools/measurement.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <ctime>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "acquisition/log_reader.hpp"
#include "acquisition/run_resident.hpp"
#include "excitation/file_error.hpp"
#include "hal/motion_controller.hpp"
#include "hal/replay_stage.hpp"
#include "tools/can_backend.hpp"
#include "tools/exit_code.hpp"
#include "tools/interrupt.hpp"
#include "tools/replay_log.hpp"

namespace stageid {
namespace {

using Json = nlohmann::ordered_json;

std::string utc_now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

std::string metadata(const ExperimentConfig& config, const MeasurementRequest& request) {
  return Json{
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
      {"stage", config.stage.text}}
      .dump();
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

CanHostOptions can_options(const ExperimentConfig& config, const MeasurementRequest& request) {
  return {request.pace >= 0.0 ? request.pace : config.stage.spec.pace, request.reset_fault};
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
  if (request.backend == Backend::can)
    return std::make_unique<LimitedStage>(
        make_can_stage(config.stage, can_options(config, request)), spec.limits);
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

/// What the stage itself knows of its trouble is part of the message.
void explain_trouble(const LimitedStage& stage, MeasurementResult& result) {
  const ExperimentEnd end = result.experiment.end;
  const std::string trouble = stage.trouble();
  if (trouble.empty() || (end != ExperimentEnd::fault && end != ExperimentEnd::limit)) return;
  // A limit that only the node saw is no violation on this side of the wires.
  const bool node_only = end == ExperimentEnd::limit && stage.violation().kind == LimitKind::none;
  result.message = node_only ? trouble : result.message + "; " + trouble;
}

void take_experiment(ExperimentResult experiment, MeasurementResult& result) {
  result.experiment = std::move(experiment);
  result.message = result.experiment.message;
  result.exit_code = exit_code_of(result.experiment);
  if (result.exit_code == kNotTrustworthy)
    result.message =
        fmt::format("{} samples are marked or missing",
                    result.experiment.health.marked + result.experiment.health.missing);
}

void close_log(SlogWriter& log, const MeasurementResult& result) {
  if (result.experiment.end != ExperimentEnd::log_failed)
    log.close(result.exit_code, result.message.c_str());
}

/// What perform() and perform_resident() need.
struct Performance {
  const ExperimentConfig& config;
  const ExperimentPlan& plan;
  const MeasurementRequest& request;
  const RunExperimentOptions& options;
  bool log_exists;

  SlogWriter open_log(const StageInfo& stage) const {
    const LogInfo info = experiment_log_info(plan, stage, metadata(config, request));
    return log_exists ? SlogWriter::resume(request.log, info)
                      : SlogWriter::create(request.log, info);
  }
};

/// The host closes the loop.
void perform(const Performance& p, MeasurementResult& result) {
  const std::unique_ptr<LimitedStage> stage =
      make_stage(p.config, p.plan, p.request, p.options.skip);
  MotionController controller(p.config.stage.spec.controller);
  SlogWriter log = p.open_log(stage->info());
  take_experiment(run_experiment(p.plan, *stage, controller, log, p.options), result);
  explain_trouble(*stage, result);
  judge_replay(*stage, result);
  close_log(log, result);
}

/// The stage closes the loop.
void perform_resident(const Performance& p, MeasurementResult& result) {
  const std::unique_ptr<ResidentStage> stage =
      make_can_resident_stage(p.config.stage, can_options(p.config, p.request));
  SlogWriter log = p.open_log(stage->info());
  take_experiment(run_resident_experiment(p.plan, *stage, log, p.options), result);
  close_log(log, result);
}

}  // namespace

void require_backend(const ExperimentConfig& config, Backend backend) {
  if (backend == Backend::modbus)
    throw std::invalid_argument(
        "--backend modbus: not in this version; there are sim, can and replay");
  if (backend == Backend::can && !config.stage.can.present)
    throw std::invalid_argument(
        fmt::format("--backend can: {} has no group 'can'; see 'stageid config schema'",
                    config.stage.file.string()));
}

std::string measurement_id_of(const LogInfo& info) {
  const Json json = Json::parse(info.metadata_json, nullptr, false);
  if (!json.is_object() || !json.contains("measurement_id") || !json["measurement_id"].is_string())
    return "";
  return json["measurement_id"].get<std::string>();
}

double expected_log_bytes(const ExperimentPlan& plan, const StageInfo& stage) {
  const auto words = static_cast<double>(stage.actuators.size() + stage.sensors.size() + 1);
  return static_cast<double>(plan.samples_per_run()) * static_cast<double>(plan.runs().size()) *
         words * 8.0;
}

MeasurementResult measure(const ExperimentConfig& config, const ExperimentPlan& plan,
                          const MeasurementRequest& request, const Console& console) {
  require_backend(config, request.backend);
  // Killed before the first byte was written: nothing is lost by starting anew.
  std::error_code no_size;
  if (request.resume && std::filesystem::file_size(request.log, no_size) == 0 && !no_size)
    std::filesystem::remove(request.log);
  const bool exists = std::filesystem::exists(request.log);
  if (exists && !request.resume)
    throw std::invalid_argument(fmt::format(
        "{}: exists already; continue it with --resume, or remove it", request.log.string()));

  RunExperimentOptions options;
  if (exists) options.skip = complete_runs(config, request.log);
  MeasurementResult result;
  result.runs_total = static_cast<int>(plan.runs().size());
  result.runs_before = static_cast<int>(options.skip.size());
  options.interrupt = &interrupt_flag();
  Progress progress(console, "run", "s of stage time");
  options.progress = [&](const ExperimentProgress& p) {
    progress.update(p.seconds_done, p.seconds_total,
                    fmt::format("run {}/{}", p.runs_done + 1, p.runs_total));
  };
  const bool resident =
      request.backend == Backend::can && config.stage.can.mode == CanMode::resident;
  const Performance performance{config, plan, request, options, exists};
  if (resident) {
    perform_resident(performance, result);
  } else {
    perform(performance, result);
  }
  result.seconds = progress.seconds();
  result.log_bytes = std::filesystem::file_size(request.log);
  return result;
}

}  // namespace stageid
