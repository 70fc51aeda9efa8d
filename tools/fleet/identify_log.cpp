#include "tools/fleet/identify_log.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/formats/open_log.hpp"
#include "estimation/modal/mode_shapes.hpp"
#include "estimation/modal/validation.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/fleet/fleet_time.hpp"
#include "tools/report/report_input.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/frf_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/steps/model_verdict.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {
namespace {

std::string folder_name(const std::filesystem::path& log) {
  return std::filesystem::absolute(log).lexically_normal().parent_path().filename().string();
}

std::string changed_utc(const std::filesystem::path& log) {
  std::error_code error;
  const auto changed = std::filesystem::last_write_time(log, error);
  if (error) return "";
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", std::chrono::floor<std::chrono::seconds>(
                                                  std::chrono::file_clock::to_sys(changed)));
}

/// Stage and time that neither table nor key determine.
void complete_from_log(Identification& job, const FleetConfig& config, const FleetLog& given,
                       const LogReader& log) {
  const auto metadata = parse_json<Json>(log.info().metadata_json);
  if (const std::string stage = text_in(metadata, "stage");
      given.stage.empty() && config.stage_name == StageName::log && !stage.empty()) {
    try {
      job.stage = stage_info(given.file, stage).name;
    } catch (const FormatError&) {  // of another version: the folder names the stage
    }
  }
  if (const std::string started = text_in(metadata, "started_utc");
      given.time_utc.empty() && days_of(started))
    job.time_utc = started;
}

std::vector<int> fitted_realizations(const FleetConfig& config, const LogReader& log) {
  if (config.validation_realization < 0) return {};
  int count = 0;
  for (const LogRun& run : log.runs()) count = std::max(count, run.realization + 1);
  if (config.validation_realization >= count || count < 2)
    fail_request(
        "{}: realization {} cannot be held back, {} are recorded; change validation_realization",
        log.path().string(), config.validation_realization + 1, count);
  std::vector<int> fitted;
  for (int m = 0; m < count; ++m)
    if (m != config.validation_realization) fitted.push_back(m);
  return fitted;
}

/// Without those outside the lines, which represent everything that the plant has there.
std::vector<StoredMode> stored_modes(const AdditiveModel& model) {
  std::vector<StoredMode> modes;
  for (const ModeShape& shape : mode_shapes(model)) {
    const Submodel& submodel = model.submodels[shape.submodel];
    const double hz = shape.natural_frequency_hz;
    if (hz < model.fit.band_hz[0] || hz > model.fit.band_hz[1]) continue;
    StoredMode mode;
    mode.frequency_hz = shape.natural_frequency_hz;
    mode.frequency_std_hz = submodel.natural_frequency_std_hz;
    mode.damping_ratio = shape.damping_ratio;
    mode.damping_ratio_std = submodel.damping_ratio_std;
    mode.modal_mass = shape.modal_mass;
    mode.output_shape = shape.output_shape;
    mode.input_shape = shape.input_shape;
    if (submodel.shape_std)
      mode.shape_std = std::hypot(submodel.shape_std->output_shape.norm(),
                                  submodel.shape_std->input_shape.norm());
    modes.push_back(std::move(mode));
  }
  std::ranges::stable_sort(modes, {}, &StoredMode::frequency_hz);
  return modes;
}

}  // namespace

Identification described_job(const FleetConfig& config, const FleetLog& log,
                             const std::string& fingerprint) {
  Identification job;
  job.job = job_id(fingerprint, config);
  job.stage = log.stage.empty() ? folder_name(log.file) : log.stage;
  job.time_utc = log.time_utc.empty() ? changed_utc(log.file) : log.time_utc;
  job.log = std::filesystem::absolute(log.file).lexically_normal();
  job.log_fingerprint = fingerprint;
  job.configuration = config.identification;
  const std::filesystem::path results = std::filesystem::absolute(config.results);
  job.results =
      is_database_url(config.store)
          ? results.lexically_normal()
          : results.lexically_proximate(std::filesystem::absolute(config.store).parent_path());
  job.tags = config.tags;
  for (const auto& tag : log.tags) {
    std::erase_if(job.tags, [&](const auto& other) { return other.first == tag.first; });
    job.tags.push_back(tag);
  }
  return job;
}

Identification identify_log(const FleetConfig& config, const FleetLog& given,
                            const std::string& fingerprint, const Console& console) {
  Identification job = described_job(config, given, fingerprint);
  const std::filesystem::path folder = job_folder(config.results, job.job);
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const std::unique_ptr<LogReader> log = open_log(given.file);
  complete_from_log(job, config, given, *log);

  FrfOptions options = config.frf;
  options.threads = 1;
  options.realizations = fitted_realizations(config, *log);
  ReportData report;
  report.frf = estimate_frf({log.get()}, options, {true, {}}, console).frf;
  write_frf(folder / "frf.h5", *report.frf);
  const std::vector<Finding> health = health_of(report.frf->provenance_json);
  if (config.validation_realization >= 0) {
    options.realizations = {config.validation_realization};
    report.validation_frf = estimate_frf({log.get()}, options, {false, {}}, console).frf;
    write_frf(folder / "frf_validation.h5", *report.validation_frf);
  }

  FitRequest request = config.fit;
  request.threads = 1;
  const FitSetup setup = make_fit_setup(request, *report.frf);
  FitStep step =
      fit_with_progress(setup, "frf.h5", fingerprint_of_file(folder / "frf.h5"), console);
  if (step.result.status() == FitStatus::interrupted) throw Interrupted();
  write_model(folder / "model.json", step.result.model);
  report.model = step.result.model;
  report.model_variance = std::move(step.result.response_variance);
  std::optional<Validation> validation;
  if (report.validation_frf)
    validation = validate(*report.model,
                          select_band(*report.validation_frf, setup.frf.frequency_hz[0],
                                      setup.frf.frequency_hz[setup.frf.lines() - 1]),
                          distortion_of(*report.model));
  report.files = {{}, {}, given.file, folder / "frf.h5", folder / "model.json"};
  const ModelVerdict verdict =
      judge_model(*report.model, health, validation, log->runs(), report.files);

  job.verdict = verdict.trustworthy ? IdentificationVerdict::trustworthy
                                    : IdentificationVerdict::not_trustworthy;
  std::vector<std::string> reasons;
  for (const Problem& problem : verdict.problems) reasons.push_back(problem.text());
  job.reasons = fmt::format("{}", fmt::join(reasons, "; "));
  job.health_json = health_json(health).dump();
  job.relative_rms_error = report.model->fit.relative_rms_error;
  job.outputs = report.model->outputs.names;
  job.inputs = report.model->inputs.names;
  job.modes = stored_modes(*report.model);

  ReportInput input;
  input.log = given.file;
  complete_report(report, input, {});
  report.title = fmt::format("{}, {}", job.stage, job.time_utc);
  write_report(folder / "report.html", report);
  return job;
}

}  // namespace stageid
