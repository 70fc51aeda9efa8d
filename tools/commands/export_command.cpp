#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/control/controller_view.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/exchange/model/covariance_file.hpp"
#include "tools/exchange/model/model_export.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// Frequencies if no FRF is given: 1000 over the band of the fit, logarithmically spaced.
Eigen::VectorXd default_lines(const AdditiveModel& model) {
  constexpr Eigen::Index kLines = 1000;
  const auto [low_hz, high_hz] = model.fit.band_hz;
  if (!(low_hz > 0.0) || !(high_hz > low_hz)) return {};
  const Eigen::ArrayXd exponent =
      Eigen::ArrayXd::LinSpaced(kLines, std::log(low_hz), std::log(high_hz));
  return exponent.exp();
}

Eigen::Index place_of(const std::string& name, const ChannelList& channels, const char* kind) {
  const auto found = std::ranges::find(channels.names, name);
  if (found == channels.names.end())
    fail_request("--driving-point: '{}' is not an {} of the model; use one of {}", name, kind,
                 fmt::join(channels.names, ", "));
  return found - channels.names.begin();
}

/// stageid export MODEL|FRF -o FILE.{json,h5,csv,mat,npz,unv,uff,py,m,h}
struct ExportFlags {
  std::filesystem::path input;
  std::filesystem::path output;
  std::filesystem::path frf;
  std::filesystem::path stage;  ///< of --controller-view; empty: none
  std::filesystem::path covariance;
  std::vector<std::string> driving_point;
  MatVersion mat_version = MatVersion::v5;
};

/// Of the FRF within the band of the fit, or default_lines().
Eigen::VectorXd lines_of(const ExportFlags& flags, const AdditiveModel& model) {
  if (flags.frf.empty()) return default_lines(model);
  const FrfEstimate frf = read_frf(flags.frf);
  const bool fitted_band = model.fit.band_hz[1] > model.fit.band_hz[0];
  return fitted_band ? select_band(frf, model.fit.band_hz[0], model.fit.band_hz[1]).frequency_hz
                     : frf.frequency_hz;
}

/// Also of an unstable mode: a simulation or an observer with it runs away.
void warn_if_doubtful(const AdditiveModel& model, const std::filesystem::path& file,
                      Console& console) {
  if (!model.fit.trustworthy())
    console.warning("{}: the fit is not to be trusted: {}", file.string(),
                    model.fit.why().front().what);
  for (const Submodel& s : model.submodels)
    if (s.is_mode() && s.damping_ratio() < 0.0)
      return console.warning(
          "{}: the mode at {:.6g} Hz is unstable (damping ratio {:.3g}); do not simulate the model",
          file.string(), s.natural_frequency_hz(), s.damping_ratio());
}

/// The loop of the model with the controller of a stage file.
void export_controller_view(const ExportFlags& flags, Console& console) {
  if (!flags.driving_point.empty())
    fail_request("--driving-point: not with --controller-view; remove one");
  require_ending(flags.output, "a controller view", {".json", ".csv"});
  require_no_input(flags.output, {flags.input, flags.frf, flags.stage, flags.covariance});
  const AdditiveModel model = read_model(flags.input);
  const Eigen::VectorXd frequency_hz = lines_of(flags, model);
  if (frequency_hz.size() == 0)
    fail_request("{}: the model does not contain its band; define the lines with --frf FRF",
                 flags.input.string());
  const StageConfig stage = load_stage_config(flags.stage);
  Eigen::MatrixXd covariance;
  if (!flags.covariance.empty()) covariance = read_covariance(flags.covariance, model);
  warn_if_doubtful(model, flags.input, console);
  ControllerView view = controller_view(stage, model, covariance, frequency_hz);
  view.model_fingerprint = fingerprint_of_file(flags.input);
  write_controller_view(flags.output, view);
  for (const std::string& line : controller_view_lines(view)) console.result(line);
  console.result("wrote {}", flags.output.string());
  Json json = {{"output", flags.output.string()}};
  json.update(controller_view_json(view, false));
  console.result(json);
  if (view.view.poles.stable()) return;
  console.exit_code = kNotTrustworthy;
  console.warning(
      "{}: the closed loop of the model is unstable, so it has no margins. Use the stage file of "
      "the measurement, or correct its controller",
      flags.stage.string());
}

void export_from_model(const ExportFlags& flags, Console& console) {
  require_export_format(flags.output);
  require_no_input(flags.output, {flags.input, flags.frf});
  const AdditiveModel model = read_model(flags.input);
  warn_if_doubtful(model, flags.input, console);
  ExportedResponse exported;
  exported.frequency_hz = lines_of(flags, model);
  std::optional<DrivingPoint> driving_point;
  if (!flags.driving_point.empty())
    driving_point = {place_of(flags.driving_point[0], model.outputs, "output"),
                     place_of(flags.driving_point[1], model.inputs, "input")};
  export_model(flags.output, model, exported, driving_point, flags.mat_version);
}

void export_from_frf(const ExportFlags& flags) {
  if (!flags.frf.empty() || !flags.driving_point.empty() || !flags.stage.empty())
    fail_request(
        "{}: is an HDF5 file, not a model; --frf, --driving-point and "
        "--controller-view need a model.json",
        flags.input.string());
  require_no_input(flags.output, {flags.input});
  const FrfEstimate frf = read_frf(flags.input);
  require_ending(flags.output, "the frequency response of " + flags.input.string(),
                 {".mat", ".npz", ".csv", ".unv", ".uff"});
  export_frf(flags.output, frf, flags.mat_version);
}

void export_file(const ExportFlags& flags, Console& console) {
  if (!flags.covariance.empty() && flags.stage.empty())
    fail_request("--covariance: needs --controller-view STAGE; add it");
  if (is_hdf5(flags.input))
    export_from_frf(flags);
  else if (!flags.stage.empty())
    return export_controller_view(flags, console);
  else
    export_from_model(flags, console);
  console.result("wrote {}, {} bytes", flags.output.string(),
                 std::filesystem::file_size(flags.output));
  console.result(
      {{"output", flags.output.string()}, {"bytes", std::filesystem::file_size(flags.output)}});
}

}  // namespace

void export_command(CLI::App& app, Console& console) {
  auto [command, flags] =
      add_command(app, console, "export",
                  "Export a model or a frequency response to other programs: state "
                  "space, mode shapes, response",
                  export_file);
  add_required(command, "input", flags.input, "model.json or frf.h5");
  add_required(command, "-o,--output", flags.output,
               "file to write: .h5, .mat, .npz, .csv, .unv (UFF text), .uff (UFF binary); for "
               "a model also .json, .py, .m, .h (C99)");
  command.add_option(
      "--frf", flags.frf,
      "for a model: evaluate the response at the lines of this FRF, within the band of the fit");
  add_value(command, "--driving-point", flags.driving_point, "CHANNEL",
            "OUTPUT INPUT at the same point and in the same direction: add the modal mass of "
            "each mode at this point to .h5, .mat or .npz")
      ->expected(2);
  command.add_option(
      "--controller-view", flags.stage,
      "STAGE, stage file: write the loop of the model with its controller to .json or .csv: "
      "Nyquist curves, sensitivity and margins");
  command.add_option("--covariance", flags.covariance,
                     "of 'fit --covariance', for --controller-view: 95 % discs and radii");
  add_mat_version(command, flags.mat_version);
}

}  // namespace stageid
