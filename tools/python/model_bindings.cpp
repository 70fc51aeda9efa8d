#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <stdexcept>
#include <utility>

#include "estimation/modal/modal_assurance.hpp"
#include "estimation/modal/mode_shapes.hpp"
#include "estimation/modal/sampled_state_space.hpp"
#include "estimation/modal/validation.hpp"
#include "tools/python/arguments.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"
#include "tools/python/pickles.hpp"
#include "tools/python/results.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

py::object mode_of(const ModeShape& shape, const Submodel& submodel) {
  const std::optional<ModeShapeDeviation>& deviations = submodel.shape_std;
  const auto deviation = [&](auto ModeShapeDeviation::*member) {
    return deviations ? py::cast((*deviations).*member) : py::none();
  };
  return result("Mode", "natural_frequency_hz"_a = shape.natural_frequency_hz,
                "damping_ratio"_a = shape.damping_ratio, "modal_mass"_a = shape.modal_mass,
                "output_shape"_a = shape.output_shape, "input_shape"_a = shape.input_shape,
                "natural_frequency_std_hz"_a = submodel.natural_frequency_std_hz,
                "damping_ratio_std"_a = submodel.damping_ratio_std,
                "modal_mass_std"_a = deviation(&ModeShapeDeviation::modal_mass),
                "output_shape_std"_a = deviation(&ModeShapeDeviation::output_shape),
                "input_shape_std"_a = deviation(&ModeShapeDeviation::input_shape));
}

py::list modes_of(const AdditiveModel& model) {
  py::list modes;
  for (const ModeShape& shape : mode_shapes(model))
    modes.append(mode_of(shape, model.submodels[shape.submodel]));
  return modes;
}

/// [m x n_y x n_u]; None: there are no matrices.
py::object stacked(const std::vector<Eigen::MatrixXd>& matrices) {
  if (matrices.empty()) return py::none();
  return py::module_::import("numpy").attr("stack")(matrices);
}

py::list submodels_of(const AdditiveModel& model) {
  py::list list;
  for (const Submodel& submodel : model.submodels)
    list.append(result("Submodel", "integrators"_a = submodel.integrators,
                       "denominator"_a = array_of(submodel.denominator),
                       "numerator"_a = stacked(submodel.numerator),
                       "numerator_std"_a = stacked(submodel.numerator_std)));
  return list;
}

py::object fit_of(const AdditiveModel& model) {
  const FitRecord& fit = model.fit;
  const auto [low_hz, high_hz] = fit.band_hz;
  return result(
      "FitRecord", "cost"_a = fit.cost, "weighting"_a = unless_empty(fit.weighting),
      "iterations"_a = fit.iterations, "status"_a = unless_empty(fit.status_word()),
      "relative_rms_error"_a = unless_nan(fit.relative_rms_error),
      "band_hz"_a = high_hz > 0.0 ? py::object(py::make_tuple(low_hz, high_hz)) : py::none());
}

py::object response_of(const AdditiveModel& model, const py::object& given) {
  const Eigen::VectorXd frequency_hz = real_vector(given, "frequency_hz");
  if (!frequency_hz.allFinite()) throw std::invalid_argument("frequency_hz: must be finite, in Hz");
  if (frequency_hz.size() == 0)
    return py::array_t<std::complex<double>>(
        {Eigen::Index{0}, model.n_outputs(), model.n_inputs()});
  return lines_moved<std::complex<double>>(response(model, frequency_hz, model.hold),
                                           model.n_outputs());
}

py::object named(const StateSpace& s) { return result("StateSpace", s.A, s.B, s.C, s.D); }

py::object continuous(const AdditiveModel& model) { return named(state_space(model)); }

py::object sampled(const AdditiveModel& model) {
  const SampledStateSpace s = sampled_state_space(model);
  return result("SampledStateSpace", "system"_a = named(s.system),
                "sample_rate_hz"_a = s.sample_rate_hz,
                "input_delay_samples"_a = s.input_delay_samples,
                "output_delay_samples"_a = s.output_delay_samples);
}

/// As `stageid validate`: the model's channels, and the band of its fit.
py::object validate_on(const AdditiveModel& model, const FrfHandle& of,
                       std::optional<std::array<double, 2>> band_hz) {
  FrfEstimate frf = select_channels(of.frf, model.inputs.names, model.outputs.names);
  if (!band_hz && model.fit.band_hz[1] > 0.0)
    band_hz = {model.fit.band_hz[0], model.fit.band_hz[1]};
  if (band_hz) frf = select_band(std::move(frf), (*band_hz)[0], (*band_hz)[1]);
  const Validation v = validate(model, frf, distortion_of(model));
  const bool compared = v.variance != ResidualVariance::none;
  const bool whitened = v.whiteness_limit > 0.0;
  const auto if_compared = [&](auto value) { return compared ? py::cast(value) : py::none(); };
  return result(
      "Validation", "relative_rms_error"_a = unless_nan(v.relative_rms_error),
      "normalized_error"_a = unless_nan(v.normalized_error),
      "variance"_a = if_compared(to_string(v.variance)),
      "chi_square_per_dof"_a = if_compared(v.chi_square_per_dof),
      "expected_chi_square"_a = compared ? unless_zero(v.expected_chi_square) : std::nullopt,
      "explained"_a = v.explained, "reason"_a = unless_empty(v.reason),
      "whitened_above_95"_a = if_compared(v.whitened_above_95),
      "whiteness"_a = whitened ? py::cast(v.whiteness) : py::none(),
      "whiteness_limit"_a = unless_zero(v.whiteness_limit),
      "channel_error"_a =
          Eigen::MatrixXd(v.channel_error.reshaped(model.n_outputs(), model.n_inputs())));
}

py::list pairs_of(const AdditiveModel& first, const AdditiveModel& second) {
  py::list list;
  for (const ModePair& pair : pair_modes(mode_shapes(first), mode_shapes(second)))
    list.append(result("ModePair", "first"_a = pair.first, "second"_a = pair.second,
                       "frequency_difference"_a = pair.frequency_difference,
                       "output_mac"_a = pair.output_mac, "input_mac"_a = pair.input_mac));
  return list;
}

void save(const AdditiveModel& model, const std::filesystem::path& file) {
  require_model_ending(file);
  write_model(file, model);
}

}  // namespace

void define_model(py::module_& module) {
  using Model = AdditiveModel;
  py::class_<Model> c(module, "Model", docstring("Model"));
  c.def(py::pickle([](const Model& m) { return state_of(m); }, &model_of_state));
  const auto of = [](const char* name) { return docstring(std::string("Model.") + name); };
  const auto property = [&](const char* name, auto get) {
    c.def_property_readonly(name, get, of(name));
  };
  property("inputs", [](const Model& m) { return m.inputs.names; });
  property("outputs", [](const Model& m) { return m.outputs.names; });
  property("sample_rate_hz", [](const Model& m) { return unless_zero(m.sample_rate_hz); });
  property("hold", [](const Model& m) { return to_string(m.hold); });
  property("input_delay_s", &Model::input_delays_s);
  property("output_delay_s", &Model::output_delays_s);
  property("input_delay_std_s",
           [](const Model& m) { return array_unless_empty(m.input_delay_std_s); });
  property("output_delay_std_s",
           [](const Model& m) { return array_unless_empty(m.output_delay_std_s); });
  property("submodels", &submodels_of);
  property("fit", &fit_of);
  property("provenance_json", [](const Model& m) { return m.provenance_json; });
  c.def("response", &response_of, "frequency_hz"_a, of("response"));
  c.def("modes", &modes_of, of("modes"));
  c.def("state_space", &continuous, of("state_space"));
  c.def("sampled_state_space", &sampled, of("sampled_state_space"));
  c.def("save", &save, "file"_a, of("save"));
  module.def("read_model", &read_model, "file"_a, docstring("read_model"));
  module.def("validate", &validate_on, "model"_a, "frf"_a, py::kw_only(), "band_hz"_a = py::none(),
             docstring("validate"));
  module.def("pair_modes", &pairs_of, "first"_a, "second"_a, docstring("pair_modes"));
}

}  // namespace stageid
