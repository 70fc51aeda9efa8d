#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/version.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "acquisition/record/log_reader.hpp"
#include "acquisition/slog/slog_scan.hpp"
#include "estimation/modal/validation.hpp"
#include "estimation/request/fit_request.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/periods/health_finding.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/model/model_export.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/experiment/loop_check.hpp"
#include "tools/experiment/run_metadata.hpp"
#include "tools/fit/frf_quality.hpp"
#include "tools/measure/measured_stage.hpp"
#include "tools/report/report_input.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/frf_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/steps/model_verdict.hpp"
#include "tools/steps/truth_comparison.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

using SteadyClock = std::chrono::steady_clock;

double seconds_since(SteadyClock::time_point start) {
  return std::chrono::duration<double>(SteadyClock::now() - start).count();
}

bool newer_than(const std::filesystem::path& output, const std::filesystem::path& input) {
  return std::filesystem::exists(output) &&
         std::filesystem::last_write_time(output) >= std::filesystem::last_write_time(input);
}

/// Whether a log has all runs.
bool is_complete(const std::filesystem::path& log, const ExperimentConfig& config,
                 const ExperimentPlan& plan) {
  if (!std::filesystem::exists(log) || is_unwritten_slog(log)) return false;
  const std::unique_ptr<LogReader> reader = open_log(log, false);
  return measurement_id_of(reader->info()) == config.measurement_id &&
         plan.runs_without(runs_without_loss(*reader)).empty();
}

constexpr std::array kResults = {"excitation.h5", "run.slog",   "frf.h5",   "frf_validation.h5",
                                 "modes.json",    "model.json", "model.h5", "model.csv",
                                 "summary.json",  "report.html"};

/// stageid identify CONFIG -o DIR
struct IdentifyFlags {
  std::filesystem::path config;
  std::filesystem::path output;
  bool resume = false;
  bool force = false;
  int threads = 0;
};

/// The main job, step by step, into one directory:
///   excitation.h5, run.slog, frf.h5, frf_validation.h5, modes.json, model.json, model.h5, model.csv,
///   summary.json, report.html
/// With `resume`, a step is skipped if its output exists, was made by the same version from the same inputs with the
/// same request, and is not older than its input.
class Identification {
 public:
  Identification(const ExperimentConfig& config, const IdentifyFlags& flags, Console& console)
      : config_(config), flags_(flags), console_(console), plan_(make_plan(config)) {}

  /// @returns the exit code: kDone, kNotTrustworthy, or that of the measurement.
  /// @throws FileError, FormatError, std::invalid_argument, StageError, Interrupted
  int run() {
    for (const char* name : kResults) note_own_file(path(name));
    require_backend(config_, config_.stage.backend, config_.stage.pace);
    say_at_interrupt("finished steps are kept; continue with --resume");
    design();
    const int measured = measure_all();
    if (measured != kDone && measured != kNotTrustworthy) return measured;
    estimate();
    pick();
    fit();
    if (model_.fit.status == FitStatus::interrupted) return kInterrupted;
    check_model();
    write_outputs();
    print_summary();
    return verdict_.trustworthy ? kDone : kNotTrustworthy;
  }

 private:
  struct Step {
    std::string name;
    double seconds = 0.0;
    std::string note;
  };

  std::filesystem::path path(const char* name) const { return flags_.output / name; }
  ResultFiles files() const {
    return {config_.file, flags_.output, path("run.slog"), path("frf.h5"), path("model.json")};
  }
  void add_notes(const std::vector<std::string>& more) {
    notes_.insert(notes_.end(), more.begin(), more.end());
  }

  void finish_step(const char* name, double seconds, std::string note) {
    console_.message("{:<9} {:6.1f} s  {}", name, seconds, note);
    steps_.push_back({name, seconds, std::move(note)});
  }

  void design() {
    const SteadyClock::time_point start = SteadyClock::now();
    if (flags_.resume && std::filesystem::exists(path("excitation.h5")) &&
        is_complete(path("run.slog"), config_, plan_)) {
      finish_step("design", seconds_since(start), "up to date");
      return;
    }
    require_within_limits(config_, predict_signals(config_, plan_, console_), flags_.force,
                          console_);
    require_directory(flags_.output);
    write_experiment_plan(path("excitation.h5"), plan_);
    finish_step("design", seconds_since(start),
                fmt::format("{}, {:.1f} min of stage time, {}", counted(plan_.runs().size(), "run"),
                            plan_.duration_s() / 60.0, counted(plan_.grid().size(), "line")));
  }

  int measure_all() {
    if (flags_.resume && is_complete(path("run.slog"), config_, plan_)) {
      finish_step("run", 0.0, "up to date");
      return kDone;
    }
    MeasurementRequest request;
    request.log = path("run.slog");
    request.resume = flags_.resume;
    request.backend = config_.stage.backend;
    const MeasurementResult result = measure(config_, plan_, request, console_);
    const double stage_s =
        static_cast<double>(result.experiment.health.cycles) / plan_.grid().sample_rate_hz();
    finish_step("run", result.seconds,
                fmt::format("{:.0f} s of stage time, {:.0f} times real-time speed, {:.0f} MB",
                            stage_s, result.seconds > 0.0 ? stage_s / result.seconds : 0.0,
                            static_cast<double>(result.log_bytes) / 1e6));
    if (result.exit_code != kDone && result.exit_code != kNotTrustworthy)
      console_.warning("{}; {} of {} runs are kept{}", named(request.log, result.message),
                       result.runs_before + result.experiment.runs_done, result.runs_total,
                       advice_behind(result));
    return result.exit_code;
  }

  std::vector<int> fitted_realizations() const {
    std::vector<int> realizations;
    for (int m = 0; m < config_.experiment.realizations; ++m)
      if (m != config_.validation_realization) realizations.push_back(m);
    return realizations;
  }

  FrfEstimate estimate_into(const char* name, const std::vector<int>& realizations) {
    FrfOptions options = config_.frf;
    options.realizations = realizations;
    options.threads = flags_.threads;
    const std::filesystem::path log = path("run.slog");
    if (flags_.resume && newer_than(path(name), log)) {
      FrfEstimate frf = read_frf(path(name));
      const std::unique_ptr<LogReader> reader = open_log(log);
      if (request_id_of(frf.provenance_json) == frf_request_id({reader.get()}, options)) {
        finish_step("frf", 0.0, fmt::format("{} up to date", name));
        return frf;
      }
    }
    // The fitted data are examined; the findings are stored in frf.h5.
    const bool fitted = realizations == fitted_realizations();
    FrfStep step = estimate_frf({log}, options, {fitted, {}}, console_);
    write_frf(path(name), step.frf);
    finish_step("frf", step.seconds,
                fmt::format("{}: {}, {:.0f} MB/s", name, describe(step.frf),
                            step.seconds > 0.0 ? step.bytes / step.seconds / 1e6 : 0.0));
    return std::move(step.frf);
  }

  void estimate() {
    frf_ = estimate_into("frf.h5", fitted_realizations());
    health_ = health_of(frf_->provenance_json);
    add_notes(health_notes(health_));
    add_notes(dropped_lines(*frf_));
    if (config_.validation_realization >= 0)
      validation_frf_ = estimate_into("frf_validation.h5", {config_.validation_realization});
  }

  void pick() {
    const SteadyClock::time_point start = SteadyClock::now();
    FitRequest request = config_.fit;
    request.threads = flags_.threads;
    setup_ = make_fit_setup(request, *frf_);
    std::vector<ModeCandidate> modes = setup_->selection.modes;
    if (modes.empty()) modes = pick_modes(setup_->frf);
    write_modes(path("modes.json"), modes);
    chosen_modes_ = std::move(modes);
    add_notes(setup_->warnings);
    finish_step("modes", seconds_since(start), fmt::format("{} candidates", chosen_modes_.size()));
  }

  bool fit_is_up_to_date(const FitSetup& setup, const std::string& frf_fingerprint) const {
    if (!flags_.resume || !std::filesystem::exists(path("model.json")) ||
        !std::filesystem::exists(path("model.h5")))
      return false;
    const AdditiveModel model = read_model(path("model.json"));
    return model.fit.status != FitStatus::interrupted &&
           request_id_of(model.provenance_json) == fit_request_id(setup, frf_fingerprint);
  }

  void fit() {
    const std::string fingerprint = fingerprint_of_file(path("frf.h5"));
    if (fit_is_up_to_date(*setup_, fingerprint)) {
      model_ = read_model(path("model.json"));
      model_variance_ = read_response_variance(path("model.h5"), setup_->frf.frequency_hz);
      finish_step("fit", 0.0, "up to date");
      return;
    }
    FitStep step = fit_with_progress(*setup_, "frf.h5", fingerprint, console_);
    model_ = step.result.model;
    model_variance_ = std::move(step.result.response_variance);
    add_notes(findings_beside_message(step.result));
    write_model(path("model.json"), model_);
    if (step.result.status() == FitStatus::interrupted)
      console_.warning("{}: {}; continue with --resume", path("model.json").string(),
                       step.result.message());
    finish_step("fit", step.seconds,
                fmt::format("{}, {}, {}", counted(model_.submodels.size(), "submodel"),
                            relative_error_text(model_.fit), cost_line(step.result.cost)));
  }

  void check_model() {
    if (validation_frf_) {
      const double low_hz = setup_->frf.frequency_hz[0];
      const double high_hz = setup_->frf.frequency_hz[setup_->frf.lines() - 1];
      validation_ =
          validate(model_, select_band(*validation_frf_, low_hz, high_hz), distortion_of(model_));
    }
    verdict_ = judge_model(model_, health_, validation_, open_log(path("run.slog"), false)->runs(),
                           files());
    if (config_.stage.plant)
      truth_ =
          compare_with_truth(model_, setup_->frf, config_.stage.spec.info, *config_.stage.plant);
  }

  void write_outputs() {
    const SteadyClock::time_point start = SteadyClock::now();
    export_model(path("model.h5"), model_, {setup_->frf.frequency_hz, model_variance_});
    export_model(path("model.csv"), model_, {});
    finish_step("export", seconds_since(start), "model.h5, model.csv");
    summary_ = summary();
    write_text_file(path("summary.json"),
                    summary_.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
    ReportData report;
    report.frf = std::move(frf_);
    report.validation_frf = std::move(validation_frf_);
    report.model = model_;
    report.model_variance = std::move(model_variance_);
    report.chosen_modes = std::move(chosen_modes_);
    ReportInput input;
    input.log = path("run.slog");
    input.summary = path("summary.json");
    complete_report(report, input, summary_);
    report.files = files();
    report.title = config_.stage.spec.info.name;
    write_report(path("report.html"), report);
  }

  Json summary() const {
    Json steps = Json::array();
    for (const Step& step : steps_)
      steps.push_back({{"name", step.name}, {"seconds", step.seconds}, {"note", step.note}});
    Json json = {{"format", "stageid-summary"},
                 {"stageid_version", version()},
                 {"configuration", config_.file.filename().string()},
                 {"configuration_fingerprint", fingerprint_of(config_.text)},
                 {"stage_fingerprint", fingerprint_of(config_.stage.text)},
                 {"fit",
                  {{"status", model_.fit.status_word()},
                   {"weighting", model_.fit.weighting},
                   {"cost", model_.fit.cost},
                   {"relative_rms_error", model_.fit.relative_rms_error},
                   {"band_hz", {model_.fit.band_hz[0], model_.fit.band_hz[1]}}}},
                 {"modes", modes_json(model_)}};
    json.update(verdict_json(verdict_));
    json.update(quality_json(*frf_));
    if (validation_) json["validation"] = validation_json(*validation_);
    if (truth_) json["truth"] = truth_json(*truth_);
    json["health"] = health_json(health_);
    json["notes"] = notes_;
    json["steps"] = steps;
    return json;
  }

  void print_summary() const {
    if (truth_) {
      for (const std::string& line : truth_table(*truth_)) console_.result(line);
      console_.result(truth_error_line(*truth_));
    }
    if (validation_) {
      console_.result("on the held-back realization:");
      for (const std::string& line : validation_lines(*validation_)) console_.result("  " + line);
    }
    if (!explain_the_rest(verdict_.problems))
      for (const std::string& note : notes_) console_.warning(note);
    for (const std::string& line : verdict_lines(verdict_)) console_.result(line);
    console_.result("report: {}", path("report.html").string());
    console_.result(summary_);
  }

  const ExperimentConfig& config_;
  const IdentifyFlags& flags_;
  Console& console_;
  ExperimentPlan plan_;
  ModelVerdict verdict_;
  std::vector<Step> steps_;
  std::vector<std::string> notes_;
  std::vector<Finding> health_;
  std::optional<FrfEstimate> frf_;
  std::optional<FrfEstimate> validation_frf_;
  std::optional<FitSetup> setup_;
  std::vector<ModeCandidate> chosen_modes_;
  AdditiveModel model_;
  Eigen::MatrixXd model_variance_;
  std::optional<Validation> validation_;
  std::optional<TruthComparison> truth_;
  Json summary_;
};

void identify(const IdentifyFlags& flags, Console& console) {
  const ExperimentConfig config = load_experiment_config(flags.config);
  if (config.experiment.scheme == ExcitationScheme::simultaneous)
    fail_request(
        "{}: scheme: 'simultaneous' does not determine a response, only the changes of "
        "a model (run --watch); write single_axis or orthogonal_dft",
        flags.config.string());
  if (!flags.resume && std::filesystem::exists(flags.output / "run.slog"))
    fail_request(
        "{}: already contains a run; continue it with --resume, or choose another "
        "directory with -o",
        flags.output.string());
  require_stable_loop(config, console);
  console.exit_code = Identification(config, flags, console).run();
}

}  // namespace

void identify_command(CLI::App& app, Console& console) {
  auto [command, flags] =
      add_command(app, console, "identify",
                  "Perform the complete identification: design, run, frf, modes, "
                  "fit, validate, export, report",
                  identify);
  add_required(command, "config", flags.config, "experiment file (.yaml)");
  add_required(command, "-o,--output", flags.output, "directory for all results");
  command.add_flag("--resume", flags.resume,
                   "continue an interrupted identification; steps that are up to date are kept");
  add_force(command, flags.force);
  add_threads(command, flags.threads);
}

}  // namespace stageid
