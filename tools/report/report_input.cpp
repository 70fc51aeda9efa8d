#include "tools/report/report_input.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "estimation/file/json_file.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/control/controller_view.hpp"
#include "tools/exchange/model/model_hdf5.hpp"
#include "tools/experiment/run_metadata.hpp"
#include "tools/report/report_comparison.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// The format in the file: "stageid-frf", "stageid-log", ...; empty if there is none.
std::string kind_of(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".slog") return "stageid-log";
  if (ending == ".yaml" || ending == ".yml") return "stageid-stage";
  if (ending == ".json") {
    const SortedJson json = parse_json<SortedJson>(read_whole_file(file));
    if (json.is_discarded())
      throw FormatError(file, "", "is not JSON, or is truncated; copy it again or write it again");
    return text_in(json, "format");
  }
  if (ending != ".h5" && ending != ".hdf5") {
    require_readable(file);
    const std::string other = other_kind(file, "a file that the report shows");
    throw FormatError(
        file, "",
        !other.empty() ? other : "cannot be shown in a report; use .slog, .h5, .json or .yaml");
  }
  const Hdf5File hdf5 = Hdf5File::open(file);
  if (!hdf5.has_attribute("/", "format")) return hdf5.exists("/response") ? "stageid-frf" : "";
  const std::string format = hdf5.read_text_attribute("/", "format");
  return format == "stageid-model" ? "stageid-model-h5" : format;
}

void put(std::filesystem::path& place, const std::filesystem::path& file) {
  if (!place.empty())
    fail_request("{}: {} is of the same kind; keep one", file.string(), place.string());
  place = file;
}

/// What a file is by its format, and its name in a directory of `identify`.
struct ReportPart {
  const char* kind;
  std::filesystem::path ReportInput::*place;
  const char* name;  ///< null: not in a directory
};
constexpr ReportPart kParts[] = {
    {"stageid-frf", &ReportInput::frf, "frf.h5"},
    {"stageid-frf", &ReportInput::validation_frf, "frf_validation.h5"},
    {"stageid-model", &ReportInput::model, "model.json"},
    {"stageid-model-h5", &ReportInput::model_h5, "model.h5"},
    {"stageid-modes", &ReportInput::modes, "modes.json"},
    {"stageid-log", &ReportInput::log, "run.slog"},
    {"stageid-summary", &ReportInput::summary, "summary.json"},
    {"stageid-controller-view", &ReportInput::controller_view, "controller_view.json"},
    {"stageid-stage", &ReportInput::stage, nullptr}};

void add_directory(ReportInput& input, const std::filesystem::path& directory) {
  for (const ReportPart& part : kParts)
    if (part.name != nullptr && std::filesystem::exists(directory / part.name))
      put(input.*part.place, directory / part.name);
  if (input.frf.empty() && input.model.empty() && input.log.empty())
    fail_request(
        "{}: contains no frf.h5, model.json or run.slog; use the output directory of "
        "'stageid identify', or files",
        directory.string());
}

/// The second response is the held-back one.
void add_file(ReportInput& input, const std::filesystem::path& file) {
  const auto of_kind = [&, kind = kind_of(file)](const ReportPart& part) {
    return part.kind == kind && (part.place != &ReportInput::frf || input.frf.empty());
  };
  const auto* const part = std::ranges::find_if(kParts, of_kind);
  if (part == std::end(kParts))
    fail_request(
        "{}: cannot be shown in a report; remove it, or use a log, FRF, model, modes, "
        "summary, controller view or stage file of stageid",
        file.string());
  put(input.*part->place, file);
}

/// Only the lines that the model was fitted to are shown, unless all are wanted.
void keep_fitted_band(ReportData& data) {
  if (data.all_lines || !data.model || !(data.model->fit.band_hz[1] > data.model->fit.band_hz[0]))
    return;
  for (std::optional<FrfEstimate>* frf : {&data.frf, &data.validation_frf})
    if (*frf)
      *frf = select_band(std::move(**frf), data.model->fit.band_hz[0], data.model->fit.band_hz[1]);
}

/// All delays of the response, which a polynomial in z should not have to approximate.
double delay_in(const FrfEstimate& frf, const std::optional<AdditiveModel>& model) {
  double delay_s = 0.0;
  if (frf.hold == Hold::zoh && frf.compensated != Compensation::hold && frf.sample_rate_hz > 0.0)
    delay_s += 0.5 / frf.sample_rate_hz;
  if (model && frf.compensated == Compensation::none) delay_s += model->mean_delay_s();
  return delay_s;
}

/// The verdicts in the file refer to all measured lines, whatever band was fitted.
void add_checks(ReportData& data) {
  const FrfEstimate& frf = *data.frf;
  if (NonlinearityTest test = linearity_of(frf); test.band_hz.rows() > 0)
    data.nonlinearity = std::move(test);
  data.findings = health_of(frf.provenance_json);
}

void add_stabilization(ReportData& data) {
  const FrfEstimate& frf = *data.frf;
  const StabilizationOptions options{.delay_s = delay_in(frf, data.model)};
  if (frf.lines() > Eigen::Index{2} * options.most_order)
    data.stabilization = stabilization(frf, options);
}

/// Reads the parts that only a summary has: the truth of a simulated plant, and the duration of the steps. Notes that
/// are in the table of findings are not repeated.
void add_summary(ReportData& data, const std::filesystem::path& file, const Json& json) {
  const JsonNode summary(file, "/", json);
  if (summary.has("truth")) {
    const JsonNode truth = summary.member("truth");
    for (const JsonNode& mode : truth.elements_of("modes"))
      data.true_modes.push_back(
          {mode.member("true_frequency_hz").number(), mode.member("true_damping_ratio").number()});
    if (const std::optional<double> error = number_in(truth.raw(), "relative_rms_error"))
      data.figures.push_back(
          {"error against the exact plant", fmt::format("{:.3g} %", 100.0 * *error)});
  }
  for (const JsonNode& step : summary.elements_of("steps"))
    data.steps.push_back(
        {text_in(step.raw(), "name"), step.number_or("seconds", 0.0), text_in(step.raw(), "note")});
  const std::vector<std::string> told =
      data.frf ? health_notes(health_of(data.frf->provenance_json)) : std::vector<std::string>();
  for (const JsonNode& note : summary.elements_of("notes"))
    if (std::ranges::find(told, note.text()) == told.end()) data.doubts.push_back(note.text());
}

/// A log contains the stage file. That of another version may have unknown keys; the shapes are then shown without
/// positions.
StageInfo geometry_of_log(const std::filesystem::path& file, const SortedJson& metadata) {
  const std::string stage = text_in(metadata, "stage");
  if (stage.empty()) return {};
  try {
    return stage_info(file, stage);
  } catch (const FormatError&) {
    return {};
  }
}

void add_log(ReportData& data, const std::filesystem::path& file) {
  const std::unique_ptr<LogReader> log = open_log(file, false);
  data.runs = log->runs();
  data.sample_rate_hz = log->info().sample_rate_hz;
  const SortedJson metadata = parse_json<SortedJson>(log->info().metadata_json);
  if (!metadata.is_object()) return;
  data.period_s = wall_period_s(log->info());
  data.geometry = geometry_of_log(file, metadata);
  for (const char* name : {"configuration", "stage"})
    if (const std::string text = text_in(metadata, name); !text.empty())
      data.documents.push_back({name, text});
}

ReportData read_response(const ReportInput& input) {
  ReportData data;
  data.all_lines = input.all_lines;
  if (!input.frf.empty()) data.frf = read_frf(input.frf);
  if (!input.validation_frf.empty()) data.validation_frf = read_frf(input.validation_frf);
  if (!input.model.empty()) data.model = read_model(input.model);
  keep_fitted_band(data);
  if (data.model && data.frf && !input.model_h5.empty())
    data.model_variance = read_response_variance(input.model_h5, data.frf->frequency_hz);
  if (!input.modes.empty()) data.chosen_modes = read_modes(input.modes);
  return data;
}

/// Completes the response data of pages and pictures: FRFs within the band of the model, response and error of the
/// model on their lines, validation, CMIF curves.
/// @param data with FRFs, model, its variance and the chosen modes, as far as they exist
void complete_response(ReportData& data) {
  keep_fitted_band(data);
  if (!data.frf) return;
  if (data.model) {
    data.model_response = response_like(*data.model, *data.frf);
    if (data.validation_frf)
      data.validation = validate(*data.model, *data.validation_frf, distortion_of(*data.model));
  }
  data.cmif_curves = cmif(*data.frf, CmifKind::accelerance);
}

}  // namespace

ReportInput report_input(const std::vector<std::filesystem::path>& files) {
  ReportInput input;
  for (auto at = files.begin(); at != files.end(); ++at) {
    const std::filesystem::path& file = *at;
    std::error_code none;
    const auto same = [&](const auto& other) {
      return std::filesystem::equivalent(file, other, none);
    };
    if (std::any_of(files.begin(), at, same))
      fail_request("{}: duplicate file; the held-back data are a different file", file.string());
    if (!std::filesystem::exists(file)) fail_file(file, "does not exist; check the path");
    if (std::filesystem::is_directory(file)) {
      add_directory(input, file);
    } else {
      add_file(input, file);
    }
  }
  return input;
}

void complete_report(ReportData& data, const ReportInput& input, const Json& summary) {
  complete_response(data);
  data.title = "stageid";
  data.files.log = input.log;
  data.files.frf = input.frf;
  data.files.model = input.model;
  if (data.frf) {
    add_checks(data);
    add_stabilization(data);
  }
  if (!input.log.empty()) add_log(data, input.log);
  if (!input.stage.empty()) data.geometry = stage_info(input.stage, read_whole_file(input.stage));
  if (!input.controller_view.empty())
    data.controller_view = read_controller_view(input.controller_view, input.model);
  if (!data.geometry.name.empty()) data.title = data.geometry.name;
  if (!summary.is_null()) add_summary(data, input.summary, summary);
}

ReportData read_response_data(const ReportInput& input) {
  ReportData data = read_response(input);
  complete_response(data);
  return data;
}

ReportData read_report_data(const ReportInput& input) {
  ReportData data = read_response(input);
  Json summary;
  if (!input.summary.empty()) summary = JsonFile(input.summary, "stageid-summary").root().raw();
  complete_report(data, input, summary);
  return data;
}

ComparedResult read_compared(const std::vector<std::filesystem::path>& files) {
  const ReportInput input = report_input(files);
  if (input.frf.empty() && input.model.empty())
    fail_request(
        "--compare {}: contains neither an FRF nor a model; use the output directory "
        "of 'stageid identify', or an FRF or model file",
        files.at(0).string());
  const std::filesystem::path first = std::filesystem::absolute(files.at(0)).lexically_normal();
  ComparedResult result;
  result.title = (first.has_filename() ? first : first.parent_path()).filename().string();
  if (!input.frf.empty()) result.frf = read_frf(input.frf);
  if (!input.model.empty()) result.model = read_model(input.model);
  return result;
}

void add_comparison(ReportData& data, const std::vector<std::filesystem::path>& files) {
  ComparedResult other = read_compared(files);
  data.comparison =
      report::make_comparison(data, std::move(other.title), std::move(other.model), other.frf);
}

}  // namespace stageid
