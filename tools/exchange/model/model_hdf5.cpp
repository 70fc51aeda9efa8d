#include "tools/exchange/model/model_hdf5.hpp"

#include <fmt/format.h>

#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "estimation/modal/modal_assurance.hpp"
#include "estimation/modal/sampled_state_space.hpp"

namespace stageid {
namespace {

void write_submodels(Hdf5File& file, const AdditiveModel& model) {
  file.create_group("/submodels");
  for (std::size_t index = 0; index < model.submodels.size(); ++index) {
    const Submodel& s = model.submodels[index];
    const std::string group = fmt::format("/submodels/{:04}", index);
    file.create_group(group);
    file.write_attribute(group, "integrators", static_cast<long long>(s.integrators));
    write_vector(file, group + "/denominator", s.denominator);
    std::vector<double> numerator;
    for (const Eigen::MatrixXd& B : s.numerator) {
      const auto rows = B.reshaped<Eigen::RowMajor>();
      numerator.insert(numerator.end(), rows.begin(), rows.end());
    }
    file.write_reals(group + "/numerator",
                     {s.numerator.size(), size_of(model.n_outputs()), size_of(model.n_inputs())},
                     numerator.data());
  }
}

std::string model_text(const AdditiveModel& model, const std::filesystem::path& beside) {
  // write_model() only writes files, so its text is read from a temporary file beside the target.
  const OutputFile scratch(beside.string() + ".json");
  write_model(scratch.path(), model);
  return read_whole_file(scratch.path());
}

/// Content needed by every reader: channels, delays, and the model in the format of stageid.
void write_head(Hdf5File& file, const std::filesystem::path& target, const AdditiveModel& model) {
  file.write_attribute("/", "format", std::string("stageid-model"));
  file.write_attribute("/", "format_version", 1LL);
  file.write_attribute("/", "sample_rate_hz", model.sample_rate_hz);
  file.write_attribute("/", "hold", std::string(to_string(model.hold)));
  write_channels(file, model);
  write_vector(file, "/input_delay_s", model.input_delays_s());
  write_vector(file, "/output_delay_s", model.output_delays_s());
  file.write_texts("/model_json", {model_text(model, target)});
}

void write_modes_table(Hdf5File& file, const AdditiveModel& model) {
  std::vector<double> frequency_hz, damping, frequency_std_hz, damping_std;
  std::vector<long long> submodel;
  for (std::size_t index = 0; index < model.submodels.size(); ++index) {
    const Submodel& s = model.submodels[index];
    if (!s.is_mode()) continue;
    frequency_hz.push_back(s.natural_frequency_hz());
    damping.push_back(s.damping_ratio());
    frequency_std_hz.push_back(s.natural_frequency_std_hz.value_or(std::nan("")));
    damping_std.push_back(s.damping_ratio_std.value_or(std::nan("")));
    submodel.push_back(static_cast<long long>(index));
  }
  write_vector(file, "/modes/natural_frequency_hz", frequency_hz);
  write_vector(file, "/modes/damping_ratio", damping);
  write_vector(file, "/modes/natural_frequency_std_hz", frequency_std_hz);
  write_vector(file, "/modes/damping_ratio_std", damping_std);
  write_vector(file, "/modes/submodel", submodel);
}

void write_mode_shapes(Hdf5File& file, const AdditiveModel& model,
                       const std::vector<ModeShape>& modes) {
  const Eigen::MatrixXcd outputs = output_shapes(modes);
  const Eigen::MatrixXcd inputs = input_shapes(modes);
  std::vector<double> mass, not_rank_one;
  for (const ModeShape& mode : modes) {
    mass.push_back(mode.modal_mass);
    not_rank_one.push_back(mode.not_rank_one);
  }
  // One shape per row: the columns follow each other as the rows of the dataset do.
  const auto n_y = static_cast<hsize_t>(model.n_outputs());
  const auto n_u = static_cast<hsize_t>(model.n_inputs());
  write_array(file, "/modes/output_shape", {modes.size(), n_y}, outputs.data());
  write_array(file, "/modes/input_shape", {modes.size(), n_u}, inputs.data());
  write_vector(file, "/modes/modal_mass", mass);
  write_vector(file, "/modes/not_rank_one", not_rank_one);
  write_matrix(file, "/modes/output_mac", modal_assurance(outputs, outputs));
  write_matrix(file, "/modes/input_mac", modal_assurance(inputs, inputs));
}

void write_driving_point(Hdf5File& file, const AdditiveModel& model, const DrivingPoint& point,
                         const std::vector<ModeShape>& modes) {
  const std::string dataset = "/modes/driving_point_mass";
  std::vector<double> mass;
  for (const ModeShape& mode : modes) mass.push_back(driving_point_mass(mode, point));
  write_vector(file, dataset, mass);
  file.write_attribute(dataset, "output", model.outputs.names.at(point.output));
  file.write_attribute(dataset, "input", model.inputs.names.at(point.input));
}

void write_rigid_body(Hdf5File& file, const AdditiveModel& model) {
  const RigidBody body = rigid_body(model);
  file.create_group("/rigid_body");
  write_vector(file, "/rigid_body/mass", body.mass);
  write_matrix(file, "/rigid_body/output_shape", body.output_shape.transpose());
  write_matrix(file, "/rigid_body/input_shape", body.input_shape.transpose());
}

/// A, B, C, D and, per state, the pole (the one with positive imaginary part in s first) and the submodel.
void write_system(Hdf5File& file, const std::string& group, const std::string& pole_name,
                  const StateSpace& system) {
  file.create_group(group);
  write_matrix(file, group + "/A", system.A);
  write_matrix(file, group + "/B", system.B);
  write_matrix(file, group + "/C", system.C);
  write_matrix(file, group + "/D", system.D);
  std::vector<std::complex<double>> poles;
  std::vector<long long> submodels;
  for (const StateBlock& block : system.blocks) {
    poles.push_back(block.pole);
    if (block.size == 2) poles.push_back(std::conj(block.pole));
    submodels.resize(poles.size(), block.submodel);
  }
  write_vector(file, group + "/" + pole_name, poles);
  write_vector(file, group + "/submodel", submodels);
}

/// /modes and /rigid_body.
void write_modal_form(Hdf5File& file, const AdditiveModel& model,
                      const std::optional<DrivingPoint>& driving_point) {
  const std::vector<ModeShape> modes = mode_shapes(model);
  file.create_group("/modes");
  write_modes_table(file, model);
  write_mode_shapes(file, model, modes);
  if (driving_point) write_driving_point(file, model, *driving_point, modes);
  write_rigid_body(file, model);
}

/// /state_space/continuous and, if the sample rate is known, /state_space/discrete.
void write_state_spaces(Hdf5File& file, const AdditiveModel& model) {
  file.create_group("/state_space");
  write_system(file, "/state_space/continuous", "pole_rad_s", state_space(model));
  if (!(model.sample_rate_hz > 0.0)) return;
  const std::string group = "/state_space/discrete";
  const SampledStateSpace sampled = sampled_state_space(model);
  write_system(file, group, "pole", sampled.system);
  file.write_attribute(group, "sample_rate_hz", sampled.sample_rate_hz);
  write_vector(file, group + "/input_delay_samples", sampled.input_delay_samples);
  write_vector(file, group + "/output_delay_samples", sampled.output_delay_samples);
}

}  // namespace

void write_channels(Hdf5File& file, const AdditiveModel& model) {
  for (const auto& [dataset, channels] :
       {std::pair{"/inputs", &model.inputs}, std::pair{"/outputs", &model.outputs}}) {
    file.write_texts(dataset, channels->names);
    file.write_attribute(dataset, "unit", channels->units);
  }
}

void write_response(Hdf5File& file, const AdditiveModel& model,
                    const Eigen::VectorXd& frequency_hz) {
  write_vector(file, "/frequency_hz", frequency_hz);
  write_columns<std::complex<double>>(file, "/response", response(model, frequency_hz, model.hold),
                                      model.n_outputs());
}

void write_model_hdf5(const std::filesystem::path& target, const AdditiveModel& model,
                      const ExportedResponse& exported,
                      const std::optional<DrivingPoint>& driving_point) {
  OutputFile output(target);
  Hdf5File file = Hdf5File::create(output.path(), target);
  write_head(file, target, model);
  write_submodels(file, model);
  write_modal_form(file, model, driving_point);
  write_state_spaces(file, model);
  if (exported.frequency_hz.size() > 0) {
    write_response(file, model, exported.frequency_hz);
    write_columns<double>(file, "/response_variance", exported.variance, model.n_outputs());
  }
  file.close();
  output.commit();
}

Eigen::MatrixXd read_response_variance(const std::filesystem::path& path,
                                       const Eigen::VectorXd& frequency_hz) {
  const Hdf5File file = Hdf5File::open(path);
  if (!file.exists("/response_variance") || !file.exists("/frequency_hz")) return {};
  const std::vector<double> lines = file.read_reals("/frequency_hz");
  if (!std::equal(lines.begin(), lines.end(), frequency_hz.begin(), frequency_hz.end())) return {};
  const std::vector<hsize_t> shape = file.shape("/response_variance");
  if (shape.size() != 3 || shape[0] != lines.size()) return {};
  return from_c_order(file.read_reals("/response_variance"), static_cast<Eigen::Index>(shape[1]),
                      static_cast<Eigen::Index>(shape[2]));
}

}  // namespace stageid
