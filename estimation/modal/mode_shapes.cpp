#include "estimation/modal/mode_shapes.hpp"

#include "acquisition/files/fail.hpp"
#include "estimation/modal/singular_shapes.hpp"
#include "estimation/modal/submodel_residues.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

}  // namespace

Complex described_pole(const Submodel& mode) {
  const std::vector<Complex> poles = pole_representatives(mode);
  return poles.size() == 2 && std::abs(poles[1]) < std::abs(poles[0]) ? poles[1] : poles[0];
}

ModeShape mode_shape(const Submodel& submodel, std::size_t index) {
  ModeShape mode;
  mode.submodel = index;
  mode.natural_frequency_hz = submodel.natural_frequency_hz();
  mode.damping_ratio = submodel.damping_ratio();
  const auto shapes = singular_shapes(
      Eigen::MatrixXcd(numerator_at(submodel, described_pole(submodel)) / submodel.denominator[2]));
  const Eigen::VectorXd& values = shapes.singular_value;
  const double seen = values[0] > 0.0 ? 1.0 : 0.0;  // no residue, no shape
  mode.output_shape = seen * shapes.output.col(0);
  mode.input_shape = seen * shapes.input.col(0);
  mode.modal_mass = 1.0 / values[0];
  mode.not_rank_one = values.size() > 1 && values[0] > 0.0 ? values[1] / values[0] : 0.0;
  return mode;
}

std::vector<ModeShape> mode_shapes(const AdditiveModel& model) {
  std::vector<ModeShape> out;
  for (std::size_t i = 0; i < model.submodels.size(); ++i)
    if (model.submodels[i].is_mode()) out.push_back(mode_shape(model.submodels[i], i));
  return out;
}

double driving_point_mass(const ModeShape& mode, const DrivingPoint& point) {
  const auto [output, input] = point;
  if (output < 0 || output >= mode.output_shape.size() || input < 0 ||
      input >= mode.input_shape.size())
    fail_request("driving point: output {} and input {} must be below {} and {}", output, input,
                 mode.output_shape.size(), mode.input_shape.size());
  return mode.modal_mass / (mode.output_shape[output] * mode.input_shape[input]).real();
}

RigidBody rigid_body(const AdditiveModel& model) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(model.n_outputs(), model.n_inputs());
  std::vector<std::size_t> members;
  for (std::size_t i = 0; i < model.submodels.size(); ++i)
    if (model.submodels[i].integrators == 2) {
      sum += model.submodels[i].numerator.at(0);
      members.push_back(i);
    }
  const auto shapes = singular_shapes(sum);
  const Eigen::VectorXd& values = shapes.singular_value;
  const Eigen::Index rank = members.size() == 1
                                ? residue_rank(model.submodels[members[0]], members[0], values)
                                : numerical_rank(values, values[0]);
  return {shapes.output.leftCols(rank), shapes.input.leftCols(rank),
          values.head(rank).cwiseInverse()};
}

}  // namespace stageid
