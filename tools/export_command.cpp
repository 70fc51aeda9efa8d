#include "tools/export_command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "frf/frf_file.hpp"
#include "tools/command_line.hpp"
#include "tools/model_export.hpp"

namespace stageid {
namespace {

/// Where no FRF says which lines: 1000 frequencies over the band of the fit, evenly in the logarithm.
Eigen::VectorXd default_lines(const AdditiveModel& model) {
  constexpr Eigen::Index kLines = 1000;
  const auto [low_hz, high_hz] = model.fit.band_hz;
  if (!(low_hz > 0.0) || !(high_hz > low_hz)) return {};
  const Eigen::ArrayXd exponent =
      Eigen::ArrayXd::LinSpaced(kLines, std::log(low_hz), std::log(high_hz));
  return exponent.exp();
}

Eigen::Index place_of(const std::string& name, const ChannelList& channels, const char* kind) {
  const auto found = std::find(channels.names.begin(), channels.names.end(), name);
  if (found == channels.names.end())
    throw std::invalid_argument(
        fmt::format("--driving-point: '{}' is no {} of the model; there are {}", name, kind,
                    fmt::join(channels.names, ", ")));
  return found - channels.names.begin();
}

}  // namespace

ExportCommand::ExportCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(
      app, "export", "Write a model for other programs: state space, mode shapes, response");
  command->add_option("model", model_, "model.json")->required();
  command->add_option("-o,--output", output_, "file to write: .json, .h5 or .csv")->required();
  command->add_option("--frf", frf_,
                      ".h5: the response on the lines of this FRF within the fit's band");
  command
      ->add_option("--driving-point", driving_point_,
                   "OUTPUT INPUT, at one place in one direction; .h5: each mode's mass there")
      ->expected(2);
  command->final_callback([this] { run(); });
}

void ExportCommand::run() const {
  require_export_format(output_);
  const AdditiveModel model = read_model(model_);
  ExportedResponse exported;
  exported.frequency_hz = default_lines(model);
  if (!frf_.empty()) {
    const FrfEstimate frf = read_frf(frf_);
    const bool fitted_band = model.fit.band_hz[1] > model.fit.band_hz[0];
    exported.frequency_hz =
        fitted_band ? select_band(frf, model.fit.band_hz[0], model.fit.band_hz[1]).frequency_hz
                    : frf.frequency_hz;
  }
  std::optional<DrivingPoint> driving_point;
  if (!driving_point_.empty())
    driving_point = {place_of(driving_point_[0], model.outputs, "output"),
                     place_of(driving_point_[1], model.inputs, "input")};
  export_model(output_, model, exported, driving_point);
  console_.result(
      fmt::format("wrote {}, {} bytes", output_.string(), std::filesystem::file_size(output_)));
  console_.result({{"output", output_.string()}, {"bytes", std::filesystem::file_size(output_)}});
}

}  // namespace stageid
