#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "estimation/modal/prediction_error.hpp"
#include "estimation/modal/validation.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/model/mode_correlation.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/frf_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/steps/model_verdict.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {
namespace {

/// An HDF5 file with the format of an FRF; all other files are treated as logs.
bool is_frf(const std::filesystem::path& file) {
  if (!is_hdf5(file)) return false;
  const Hdf5File hdf5 = Hdf5File::open(file);
  if (hdf5.has_attribute("/", "format"))
    return hdf5.read_text_attribute("/", "format") == "stageid-frf";
  return hdf5.exists("/response");
}

Json prediction_json(const PredictionError& error) {
  return {{"sensors", error.sensors},
          {"error_rms", error.error_rms},
          {"signal_rms", error.signal_rms},
          {"normalized", error.normalized()},
          {"runs", error.runs},
          {"band_hz", {error.band_hz[0], error.band_hz[1]}}};
}

std::vector<std::string> prediction_lines(const PredictionError& error) {
  std::vector<std::vector<std::string>> rows = {{"sensor", "error rms", "signal rms", "ratio"}};
  for (std::size_t i = 0; i < error.sensors.size(); ++i) {
    rows.push_back({error.sensors[i], fmt::format("{:.4g}", error.error_rms[i]),
                    fmt::format("{:.4g}", error.signal_rms[i]),
                    fmt::format("{:.3e}", error.error_rms[i] / error.signal_rms[i])});
  }
  std::vector<std::string> lines = {
      fmt::format("prediction of the sensor samples from the actuators, {}, {} ... {} Hz:",
                  counted(error.runs, "run"), error.band_hz[0], error.band_hz[1])};
  for (std::string& line : table_lines(rows)) lines.push_back(std::move(line));
  return lines;
}

/// stageid validate MODEL FRF|LOG|MODE_SHAPES
struct ValidateFlags {
  std::filesystem::path model;
  std::filesystem::path data;
  std::filesystem::path stage;
  std::vector<double> band_hz;
  int threads = 0;
};

void require_channels(const ValidateFlags& flags, const std::vector<std::string>& of_data,
                      const std::vector<std::string>& of_model, const char* kind) {
  for (const std::string& name : of_model)
    if (std::ranges::find(of_data, name) == of_data.end())
      fail_format(flags.data, "",
                  "has no {0} '{1}', which {2} has; its {0}s are {3}. Use data "
                  "and a model of the same stage",
                  kind, name, flags.model.string(), fmt::join(of_data, ", "));
}

/// With other channels than the model's, every process reads all of them.
FrfEstimate read_for(const AdditiveModel& model, const std::filesystem::path& file,
                     const Team* team) {
  FrfEstimate frf = read_frf(file, team);
  const bool same =
      frf.inputs.names == model.inputs.names && frf.outputs.names == model.outputs.names;
  return same ? frf : read_frf(file);
}

void validate_model(const ValidateFlags& flags, Console& console) {
  const AdditiveModel model = read_model(flags.model);
  if (is_uff_name(flags.data)) {
    const ModeCorrelation correlation = correlate_modes(model, flags.data, read_uff(flags.data));
    for (const std::string& line : correlation_lines(correlation)) console.result(line);
    console.result({{"model", flags.model.string()},
                    {"data", flags.data.string()},
                    {"modes", correlation_json(correlation)}});
    return;
  }
  const bool from_frf = is_frf(flags.data);
  FrfOptions options;
  options.inputs = model.inputs.names;
  options.outputs = model.outputs.names;
  options.threads = flags.threads;
  options.team = console.team;
  FrfStep step;
  if (from_frf)
    step.frf = read_for(model, flags.data, console.team);
  else
    step = estimate_frf({flags.data}, options, {true, flags.stage}, console);
  const std::vector<Finding> health = health_of(step.frf.provenance_json);
  require_channels(flags, step.frf.outputs.names, model.outputs.names, "output");
  require_channels(flags, step.frf.inputs.names, model.inputs.names, "input");
  FrfEstimate frf = select_channels(std::move(step.frf), model.inputs.names, model.outputs.names);
  std::array<double, 2> band_hz = {frf.frequency_hz[0], frf.frequency_hz[frf.lines() - 1]};
  if (model.fit.band_hz[1] > 0.0) std::ranges::copy(model.fit.band_hz, band_hz.begin());
  std::ranges::copy(flags.band_hz, band_hz.begin());  // none or two
  const auto [low_hz, high_hz] = band_hz;
  const Validation validation =
      validate(model, select_band(std::move(frf), low_hz, high_hz), distortion_of(model));
  for (const std::string& line : validation_lines(validation)) console.result(line);
  Json json = {{"model", flags.model.string()},
               {"data", flags.data.string()},
               {"band_hz", {low_hz, high_hz}},
               {"frequency_domain", validation_json(validation)}};
  std::vector<LogRun> runs;
  if (!from_frf) {
    for (const std::string& line : health_lines(health)) console.result(line);
    json["health"] = health_json(health);
    const std::unique_ptr<LogReader> log = open_log(flags.data);
    runs = log->runs();
    const PredictionError error = prediction_error(model, *log, low_hz, high_hz);
    for (const std::string& line : prediction_lines(error)) console.result(line);
    json["time_domain"] = prediction_json(error);
  }
  ResultFiles files;
  files.model = flags.model;
  if (!from_frf) files.log = flags.data;
  const ModelVerdict verdict = judge_model(model, health, validation, runs, files);
  for (const std::string& line : verdict_lines(verdict)) console.result(line);
  json.update(verdict_json(verdict));
  if (!verdict.trustworthy) console.exit_code = kNotTrustworthy;
  console.result(json);
}

}  // namespace

void validate_command(CLI::App& app, Console& console) {
  auto [command, flags] =
      add_command(app, console, "validate", "Validate a model on data that it was not fitted to",
                  validate_model);
  add_required(command, "model", flags.model, "model.json");
  add_required(command, "data", flags.data,
               "frf.h5, a log (.slog or .h5), or mode shapes of another program (.unv, .uff)");
  add_band(command, flags.band_hz, "the band of the fit");
  command.add_option(
      "--stage", flags.stage,
      "stage or controller file for the health checks of a log; default: the one stored in it");
  add_threads(command, flags.threads);
}

}  // namespace stageid
