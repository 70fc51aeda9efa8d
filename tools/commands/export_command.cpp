#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/files/file_kind.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/exchange/model/model_export.hpp"
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
  const auto found = std::find(channels.names.begin(), channels.names.end(), name);
  if (found == channels.names.end())
    throw std::invalid_argument(
        fmt::format("--driving-point: '{}' is not an {} of the model; use one of {}", name, kind,
                    fmt::join(channels.names, ", ")));
  return found - channels.names.begin();
}

/// stageid export MODEL|FRF -o FILE.{json,h5,csv,mat,npz,unv,uff,py,m}
class ExportCommand {
 public:
  ExportCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  void export_from_model() const;
  void export_from_frf() const;

  Console& console_;
  std::filesystem::path input_;
  std::filesystem::path output_;
  std::filesystem::path frf_;
  std::vector<std::string> driving_point_;
  MatVersion mat_version_ = MatVersion::v5;
};

ExportCommand::ExportCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(app, "export",
                                  "Export a model or a frequency response to other programs: state "
                                  "space, mode shapes, response");
  command->add_option("input", input_, "model.json or frf.h5")->required();
  command
      ->add_option("-o,--output", output_,
                   "file to write: .h5, .mat, .npz, .csv, .unv (UFF text), .uff (UFF binary); for "
                   "a model also .json, .py, .m")
      ->required();
  command->add_option(
      "--frf", frf_,
      "for a model: evaluate the response at the lines of this FRF, within the band of the fit");
  command
      ->add_option("--driving-point", driving_point_,
                   "OUTPUT INPUT at the same point and in the same direction; .h5, .mat, .npz: "
                   "adds the modal mass of each mode there")
      ->expected(2);
  add_mat_version(*command, mat_version_);
  command->final_callback([this] { run(); });
}

void ExportCommand::export_from_model() const {
  require_export_format(output_);
  require_no_input(output_, {input_, frf_});
  const AdditiveModel model = read_model(input_);
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
  export_model(output_, model, exported, driving_point, mat_version_);
}

void ExportCommand::export_from_frf() const {
  if (!frf_.empty() || !driving_point_.empty())
    throw std::invalid_argument(
        fmt::format("{}: is an HDF5 file, not a model; --frf and --driving-point need a model.json",
                    input_.string()));
  require_no_input(output_, {input_});
  const FrfEstimate frf = read_frf(input_);
  try {
    require_frf_export_format(output_);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(
        fmt::format("{}: contains a frequency response; {}", input_.string(), error.what()));
  }
  export_frf(output_, frf, mat_version_);
}

void ExportCommand::run() const {
  if (is_hdf5(input_))
    export_from_frf();
  else
    export_from_model();
  console_.result(
      fmt::format("wrote {}, {} bytes", output_.string(), std::filesystem::file_size(output_)));
  console_.result({{"output", output_.string()}, {"bytes", std::filesystem::file_size(output_)}});
}

}  // namespace

std::shared_ptr<void> export_command(CLI::App& app, Console& console) {
  return std::make_shared<ExportCommand>(app, console);
}

}  // namespace stageid
