#include "tools/exchange/model/model_export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/version.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/exchange/arrays/frf_arrays.hpp"
#include "tools/exchange/arrays/frf_csv.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/exchange/model/model_code.hpp"
#include "tools/exchange/model/model_script.hpp"
#include "tools/exchange/uff/uff_frf.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

void write_arrays(const std::filesystem::path& file, ArrayList list, MatVersion mat_version) {
  list.file = file;
  if (file.extension() == ".mat")
    write_mat(file, list, mat_version);
  else
    write_npz(file, list);
}

/// The content of the .h5 file of the model, read from a temporary file beside the target.
ArrayList arrays_of_model(const std::filesystem::path& beside, const AdditiveModel& model,
                          const ExportedResponse& response,
                          const std::optional<DrivingPoint>& driving_point) {
  const OutputFile scratch(beside);
  write_model_hdf5(scratch.path(), model, response, driving_point);
  return read_hdf5_arrays(scratch.path());
}

std::string number_or_nothing(const std::optional<double>& value) {
  return value ? fmt::format("{}", *value) : "";
}

/// A model as a table with one line per coefficient; the lines that begin with # describe it.
/// @throws std::invalid_argument if a submodel is neither a mode nor an integrator.
std::string model_csv(const AdditiveModel& model) {
  std::string text = fmt::format(
      "# stageid-model 1, written by stageid {}; hold {}, sample rate {} Hz\n"
      "# P(s) = sum over submodels of coefficient s^power_of_s / (s^integrators A(s)), SI units, s "
      "in rad/s\n"
      "# A(s) = 1 + 2 zeta s/omega + s^2/omega^2, or 1 where natural_frequency_hz is empty\n"
      "submodel,integrators,natural_frequency_hz,natural_frequency_std_hz,damping_ratio,"
      "damping_ratio_std,power_of_s,output,input,coefficient\n",
      version(), to_string(model.hold), model.sample_rate_hz);
  for (std::size_t index = 0; index < model.submodels.size(); ++index) {
    const Submodel& s = model.submodels[index];
    if (s.denominator.size() > 1 && !s.is_mode())
      fail_request(
          "submodel {} is neither a mode nor an integrator; the .csv table cannot represent it, "
          "export as .json or .h5",
          index);
    const std::string head =
        s.is_mode()
            ? fmt::format("{},{},{},{},{},{}", index, s.integrators, s.natural_frequency_hz(),
                          number_or_nothing(s.natural_frequency_std_hz), s.damping_ratio(),
                          number_or_nothing(s.damping_ratio_std))
            : fmt::format("{},{},,,,", index, s.integrators);
    for (std::size_t power = 0; power < s.numerator.size(); ++power)
      for (Eigen::Index i = 0; i < model.n_outputs(); ++i)
        for (Eigen::Index j = 0; j < model.n_inputs(); ++j)
          text += fmt::format("{},{},{},{},{}\n", head, power, csv_field(model.outputs.name(i)),
                              csv_field(model.inputs.name(j)), s.numerator[power](i, j));
  }
  return text;
}

/// Three values per node, because common readers only support 3 and 6, not the scalars of the format. A scalar output
/// is stored as X (note 15 of the format: unused degrees of freedom are zero).
UffMode uff_mode(const ModeShape& shape, const ChannelList& outputs) {
  UffMode mode;
  mode.complex = !shape.output_shape.imag().isZero(0.0);
  const double omega = 2.0 * std::numbers::pi * shape.natural_frequency_hz;
  const double zeta = shape.damping_ratio;
  const double damped = omega * std::sqrt(std::max(0.0, 1.0 - zeta * zeta));
  mode.frequency_hz = shape.natural_frequency_hz;
  mode.damping_ratio = zeta;
  mode.modal_mass = shape.modal_mass;
  mode.pole_rad_s = {-zeta * omega, damped};
  mode.modal_a = {0.0, 2.0 * damped * shape.modal_mass};
  mode.values_per_node = 3;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    mode.nodes.push_back(static_cast<long long>(i) + 1);
    const std::complex<double> value = shape.output_shape[i];
    const int direction = std::max(1, uff_direction(outputs.names[i]));
    for (int axis = 1; axis <= 3; ++axis) mode.values.push_back(axis == direction ? value : 0.0);
  }
  return mode;
}

/// The modes of a model as datasets 55: shapes of the outputs at nodes 1 .. n_y, the nodes of uff_of_frf(). Every node
/// has three values. Names that begin with x, y or z give the direction; other outputs are stored as X. Real shapes
/// are normal modes with natural frequency, modal mass and damping ratio; complex ones are eigenvalues with modal A =
/// 2 j omega sqrt(1 - zeta^2) modal_mass, so that the residue is shape_out shape_in^T / A. Source of the scaling:
/// estimation/modal/mode_shapes.hpp.
std::vector<UffMode> uff_modes(const AdditiveModel& model) {
  std::vector<UffMode> modes;
  for (const ModeShape& shape : mode_shapes(model)) {
    if (!std::isfinite(shape.modal_mass)) continue;
    modes.push_back(uff_mode(shape, model.outputs));
    UffMode& mode = modes.back();
    mode.number = static_cast<int>(modes.size());
    mode.id[0] = fmt::format("mode {}: {:.6g} Hz, damping ratio {:.4g}", mode.number,
                             mode.frequency_hz, mode.damping_ratio);
  }
  return modes;
}

UffContent uff_of_model(const std::filesystem::path& file, const AdditiveModel& model,
                        const Eigen::VectorXd& frequency_hz) {
  if (frequency_hz.size() == 0)
    fail_request(
        "{}: the model does not contain its band; define the lines of the response with --frf FRF",
        file.string());
  FrfEstimate frf;
  frf.frequency_hz = frequency_hz;
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.sample_rate_hz = model.sample_rate_hz;
  frf.hold = model.hold == HoldModel::none ? Hold::none : Hold::zoh;
  frf.response = stageid::response(model, frequency_hz, model.hold);
  UffContent content = uff_of_frf(frf);
  content.model_name = "stageid model";
  content.modes = uff_modes(model);
  return content;
}

}  // namespace

void require_export_format(const std::filesystem::path& file) {
  require_ending(
      file, "a model",
      {".json", ".h5", ".hdf5", ".csv", ".mat", ".npz", ".unv", ".uff", ".py", ".m", ".h"});
}

void export_model(const std::filesystem::path& file, const AdditiveModel& model,
                  const ExportedResponse& response,
                  const std::optional<DrivingPoint>& driving_point, MatVersion mat_version) {
  require_export_format(file);
  const std::string ending = file.extension().string();
  if (ending == ".json")
    write_model(file, model);
  else if (ending == ".csv")
    write_text_file(file, model_csv(model));
  else if (ending == ".py" || ending == ".m")
    write_text_file(
        file, model_script(model, ending == ".m" ? ScriptLanguage::matlab : ScriptLanguage::python,
                           file.stem().string()));
  else if (ending == ".h")
    write_text_file(file, model_code(model, file.stem().string()));
  else if (is_uff_name(file))
    write_uff(file, uff_of_model(file, model, response.frequency_hz));
  else if (ending == ".mat" || ending == ".npz")
    write_arrays(file, arrays_of_model(file, model, response, driving_point), mat_version);
  else
    write_model_hdf5(file, model, response, driving_point);
}

void export_frf(const std::filesystem::path& file, const FrfEstimate& frf, MatVersion mat_version) {
  if (is_uff_name(file))
    write_uff(file, uff_of_frf(frf));
  else if (file.extension() == ".csv")
    write_text_file(file, frf_csv(frf));
  else
    write_arrays(file, arrays_of_frf(frf, file), mat_version);
}

}  // namespace stageid
