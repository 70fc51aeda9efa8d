#include "tools/exchange/model/modal_hdf5.hpp"

#include <fmt/format.h>

#include <cmath>
#include <complex>
#include <vector>

#include "acquisition/files/hdf5_matrices.hpp"
#include "estimation/modal/modal_assurance.hpp"
#include "estimation/modal/sampled_state_space.hpp"

namespace stageid {
namespace {

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
  file.write_attribute(dataset, "output",
                       model.outputs.names.at(static_cast<std::size_t>(point.output)));
  file.write_attribute(dataset, "input",
                       model.inputs.names.at(static_cast<std::size_t>(point.input)));
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

}  // namespace

void write_modal_form(Hdf5File& file, const AdditiveModel& model,
                      const std::optional<DrivingPoint>& driving_point) {
  const std::vector<ModeShape> modes = mode_shapes(model);
  file.create_group("/modes");
  write_modes_table(file, model);
  write_mode_shapes(file, model, modes);
  if (driving_point) write_driving_point(file, model, *driving_point, modes);
  write_rigid_body(file, model);
}

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

}  // namespace stageid
