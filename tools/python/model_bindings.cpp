#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <memory>
#include <stdexcept>
#include <utility>

#include "estimation/modal/modal_assurance.hpp"
#include "estimation/modal/modal_form.hpp"
#include "estimation/modal/sampled_state_space.hpp"
#include "estimation/modal/validation.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"
#include "tools/python/numpy_arrays.hpp"
#include "tools/python/pickles.hpp"
#include "tools/python/real_arrays.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

namespace py = pybind11;

py::object number_or_none(const std::optional<double>& value) {
  return value ? py::object(py::float_(*value)) : py::object(py::none());
}

py::object deviation_or_none(const Eigen::VectorXd& values) {
  return values.size() > 0 ? py::cast(values) : py::object(py::none());
}

py::list modes_of(const AdditiveModel& model) {
  py::list modes;
  for (const ModeShape& shape : mode_shapes(model)) {
    const Submodel& submodel = model.submodels[shape.submodel];
    py::dict mode;
    mode["natural_frequency_hz"] = shape.natural_frequency_hz;
    mode["natural_frequency_std_hz"] = number_or_none(submodel.natural_frequency_std_hz);
    mode["damping_ratio"] = shape.damping_ratio;
    mode["damping_ratio_std"] = number_or_none(submodel.damping_ratio_std);
    mode["modal_mass"] = shape.modal_mass;
    mode["output_shape"] = shape.output_shape;
    mode["input_shape"] = shape.input_shape;
    const std::optional<ModeShapeDeviation>& deviation = submodel.shape_std;
    mode["modal_mass_std"] = deviation ? py::object(py::float_(deviation->modal_mass)) : py::none();
    mode["output_shape_std"] = deviation ? py::cast(deviation->output_shape) : py::none();
    mode["input_shape_std"] = deviation ? py::cast(deviation->input_shape) : py::none();
    modes.append(mode);
  }
  return modes;
}

py::list submodels_of(const AdditiveModel& model) {
  py::list list;
  for (const Submodel& submodel : model.submodels) {
    py::dict entry;
    entry["integrators"] = submodel.integrators;
    entry["denominator"] = submodel.denominator;
    entry["numerator"] = submodel.numerator;
    entry["numerator_std"] = submodel.numerator_std;
    list.append(entry);
  }
  return list;
}

py::dict fit_of(const AdditiveModel& model) {
  const FitRecord& fit = model.fit;
  py::dict out;
  out["cost"] = fit.cost;
  out["weighting"] = fit.weighting;
  out["iterations"] = fit.iterations;
  out["status"] = fit.status;
  out["relative_rms_error"] = fit.relative_rms_error;
  out["band_hz"] = py::make_tuple(fit.band_hz[0], fit.band_hz[1]);
  return out;
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

py::tuple continuous(const AdditiveModel& model) {
  const StateSpace s = state_space(model);
  return py::make_tuple(s.A, s.B, s.C, s.D);
}

py::tuple sampled(const AdditiveModel& model) {
  const SampledStateSpace s = sampled_state_space(model);
  return py::make_tuple(s.system.A, s.system.B, s.system.C, s.system.D, s.input_delay_samples,
                        s.output_delay_samples);
}

/// As `stageid validate`: the model's channels, and the band of its fit.
py::dict validate_on(const AdditiveModel& model, const FrfHandle& of,
                     std::optional<std::array<double, 2>> band_hz) {
  FrfEstimate frf = select_channels(of.frf, model.inputs.names, model.outputs.names);
  if (!band_hz && model.fit.band_hz[1] > 0.0)
    band_hz = {model.fit.band_hz[0], model.fit.band_hz[1]};
  if (band_hz) frf = select_band(std::move(frf), (*band_hz)[0], (*band_hz)[1]);
  const Validation v = validate(model, frf, distortion_of(model));
  py::dict out;
  out["relative_rms_error"] = v.relative_rms_error;
  out["normalized_error"] = v.normalized_error;
  out["chi_square_per_dof"] = v.chi_square_per_dof;
  out["expected_chi_square"] = v.expected_chi_square;
  out["variance"] = to_string(v.variance);
  out["explained"] = v.explained;
  out["reason"] = v.reason;
  out["whitened_above_95"] = v.whitened_above_95;
  out["whiteness"] = v.whiteness;
  out["whiteness_limit"] = v.whiteness_limit;
  out["channel_error"] =
      Eigen::MatrixXd(v.channel_error.reshaped(model.n_outputs(), model.n_inputs()));
  return out;
}

py::list pairs_of(const AdditiveModel& first, const AdditiveModel& second) {
  py::list list;
  for (const ModePair& pair : pair_modes(mode_shapes(first), mode_shapes(second))) {
    py::dict entry;
    entry["first"] = pair.first;
    entry["second"] = pair.second;
    entry["frequency_difference"] = pair.frequency_difference;
    entry["output_mac"] = pair.output_mac;
    entry["input_mac"] = pair.input_mac;
    list.append(entry);
  }
  return list;
}

constexpr const char* kResponseDoc =
    R"(P(j omega) including hold and delays of the model, complex128 [N, n_y, n_u], unit of output over unit of input.

frequency_hz is an array [N] in Hz, or one number (N = 1). The result is not copied.
Raises RequestError if a frequency is not finite, or above the Nyquist frequency of a model with a hold.)";

constexpr const char* kModesDoc =
    R"(A list of dicts: natural_frequency_hz and damping_ratio with natural_frequency_std_hz (Hz) and
damping_ratio_std (None if unknown), modal_mass (kg for N and m), output_shape [n_y], input_shape [n_u], and
modal_mass_std, output_shape_std, input_shape_std (real part: deviation of the real parts, imaginary part: of the
imaginary parts; None if unknown).)";

constexpr const char* kSubmodelsDoc =
    R"(A list of dicts: integrators, denominator [1, a_1, ...], numerator [B_0, B_1, ...] of [n_y, n_u] each, and
numerator_std; SI units, s in rad/s.)";

constexpr const char* kSampledDoc =
    R"(A, B, C, D with a zero-order hold at sample_rate_hz, and the additional delays of the inputs [n_u] and
outputs [n_y] in whole samples (int64).

Raises RequestError if the model has no sample rate.)";

constexpr const char* kValidateDoc =
    R"(Validates the model on a response to which it was not fitted, in band_hz (Hz); None: the band of the fit.

Returns a dict: relative_rms_error, normalized_error, chi_square_per_dof (0: unknown),
expected_chi_square (for noise alone; 1 for exact variances), variance (the reference: 'none', 'noise', 'total' or
'scatter'), explained (False: clearly more than noise and known distortion) and reason, whitened_above_95 (ideally
0.05), whiteness and whiteness_limit, channel_error [n_y, n_u].
Raises RequestError if the channel names differ.)";

constexpr const char* kPairsDoc =
    R"(Pairs the modes of two models with the same channels by frequency and shape.

Returns a list of dicts: first and second (indices into modes()), frequency_difference (relative),
output_mac, input_mac (0 to 1). Raises RequestError if the numbers of channels differ.)";

}  // namespace

void define_model(py::module_& module) {
  using Model = AdditiveModel;
  py::class_<Model>(module, "Model",
                    "The model P(s) = sum of submodels, with delays: the content of model.json.")
      .def_property_readonly(
          "inputs", [](const Model& m) { return m.inputs.names; }, "Names [n_u]")
      .def_property_readonly(
          "outputs", [](const Model& m) { return m.outputs.names; }, "Names [n_y]")
      .def_readonly("sample_rate_hz", &Model::sample_rate_hz, "Hz; 0: unknown")
      .def_property_readonly(
          "hold", [](const Model& m) { return to_string(m.hold); },
          "'none', 'phase', 'sinc' or 'exact'")
      .def_property_readonly("input_delay_s", &Model::input_delays_s, "s, [n_u]")
      .def_property_readonly("output_delay_s", &Model::output_delays_s, "s, [n_y]")
      .def_property_readonly(
          "input_delay_std_s",
          [](const Model& m) { return deviation_or_none(m.input_delay_std_s); },
          "Standard deviation in s, [n_u]; None if the delay was given, or if unknown")
      .def_property_readonly(
          "output_delay_std_s",
          [](const Model& m) { return deviation_or_none(m.output_delay_std_s); },
          "Standard deviation in s, [n_y]; None if the delay was given, or if unknown. With delays "
          "per channel the last output is the reference, 0")
      .def_property_readonly("submodels", &submodels_of, kSubmodelsDoc)
      .def_property_readonly(
          "fit", &fit_of,
          "The fit, a dict: cost, weighting, iterations, status, relative_rms_error, band_hz")
      .def_readonly("provenance_json", &Model::provenance_json,
                    "Input files with their hashes, options and versions, as JSON")
      .def(py::pickle([](const Model& m) { return state_of(m); }, &model_of_state))
      .def("response", &response_of, py::arg("frequency_hz"), kResponseDoc)
      .def("modes", &modes_of, kModesDoc)
      .def("state_space", &continuous,
           "Continuous A [n, n], B [n, n_u], C [n_y, n], D [n_y, n_u] without delays, rad/s.")
      .def("sampled_state_space", &sampled, kSampledDoc)
      .def(
          "save",
          [](const Model& m, const std::filesystem::path& file) {
            require_model_ending(file);
            write_model(file, m);
          },
          py::arg("file"),
          "Writes model.json atomically. Raises FileError, RequestError for another ending.");
  module.def("read_model", &read_model, py::arg("file"),
             "Reads model.json and returns a Model. Raises FileError, FormatError.");
  module.def("validate", &validate_on, py::arg("model"), py::arg("frf"), py::kw_only(),
             py::arg("band_hz") = py::none(), kValidateDoc);
  module.def("pair_modes", &pairs_of, py::arg("first"), py::arg("second"), kPairsDoc);
}

}  // namespace stageid
