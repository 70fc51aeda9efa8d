// The Python module: numpy in and out, every number from the functions that the program calls.

#include <pybind11/complex.h>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "acquisition/log_reader.hpp"
#include "estimation/modal_form.hpp"
#include "estimation/sampled_state_space.hpp"
#include "excitation/multisine.hpp"
#include "frf/frf_file.hpp"
#include "tools/program.hpp"

namespace stageid {
namespace {

namespace py = pybind11;

/// [N x n_y x n_u] from columns that are vec of an n_y x n_u matrix; None where there is nothing.
template <typename Scalar>
py::object lines_first(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& columns,
                       Eigen::Index n_y) {
  if (columns.size() == 0) return py::none();
  const Eigen::Index n_u = columns.rows() / n_y;
  py::array_t<Scalar> array({columns.cols(), n_y, n_u});
  auto out = array.template mutable_unchecked<3>();
  for (Eigen::Index k = 0; k < columns.cols(); ++k)
    for (Eigen::Index i = 0; i < n_y; ++i)
      for (Eigen::Index j = 0; j < n_u; ++j) out(k, i, j) = columns(i + n_y * j, k);
  return array;
}

Eigen::VectorXd multisine(double sample_rate_hz, int period_samples, double low_hz, double high_hz,
                          double rms, std::uint64_t seed) {
  const LineSpec lines{.low_hz = low_hz, .high_hz = high_hz, .selection = LineSelection::all};
  MultisineSpec spec;
  spec.level = rms;
  spec.seed = seed;
  return random_phase_multisine(FrequencyGrid::band(sample_rate_hz, period_samples, lines), spec)
      .samples;
}

py::dict frf_as_dict(const std::filesystem::path& file) {
  const FrfEstimate frf = read_frf(file);
  py::dict out;
  out["frequency_hz"] = frf.frequency_hz;
  out["response"] = lines_first<std::complex<double>>(frf.response, frf.n_outputs());
  out["noise_variance"] = lines_first<double>(frf.noise_variance, frf.n_outputs());
  out["total_variance"] = lines_first<double>(frf.total_variance, frf.n_outputs());
  out["inputs"] = frf.inputs.names;
  out["outputs"] = frf.outputs.names;
  out["sample_rate_hz"] = frf.sample_rate_hz;
  return out;
}

py::list log_as_list(const std::filesystem::path& file) {
  const std::unique_ptr<LogReader> log = open_log(file);
  py::list runs;
  for (std::size_t run = 0; run < log->runs().size(); ++run) {
    const LogRun& about = log->runs()[run];
    LogSamples samples;
    log->read(run, 0, about.samples, samples);
    py::dict out;
    out["realization"] = about.realization;
    out["experiment"] = about.experiment;
    out["complete"] = about.complete;
    out["excitation"] = log->excitation(run);
    out["actuators"] = samples.actuators;
    out["sensors"] = samples.sensors;
    runs.append(out);
  }
  return runs;
}

py::list modes_of(const AdditiveModel& model) {
  py::list modes;
  for (const ModeShape& shape : mode_shapes(model)) {
    py::dict mode;
    mode["natural_frequency_hz"] = shape.natural_frequency_hz;
    mode["damping_ratio"] = shape.damping_ratio;
    mode["modal_mass"] = shape.modal_mass;
    mode["output_shape"] = shape.output_shape;
    mode["input_shape"] = shape.input_shape;
    modes.append(mode);
  }
  return modes;
}

int call(const py::args& arguments) {
  std::vector<std::string> words = {"stageid"};
  for (const py::handle& argument : arguments) words.push_back(py::str(argument));
  std::vector<const char*> pointers;
  for (const std::string& word : words) pointers.push_back(word.c_str());
  return run_program(static_cast<int>(pointers.size()), pointers.data());
}

void define_model(py::module_& module) {
  py::class_<AdditiveModel>(module, "Model", "P(s) = sum of submodels, with delays: model.json")
      .def_property_readonly("inputs", [](const AdditiveModel& m) { return m.inputs.names; })
      .def_property_readonly("outputs", [](const AdditiveModel& m) { return m.outputs.names; })
      .def_readonly("sample_rate_hz", &AdditiveModel::sample_rate_hz, "[Hz]; 0: unknown")
      .def(
          "response",
          [](const AdditiveModel& m, const Eigen::VectorXd& frequency_hz) {
            return lines_first<std::complex<double>>(response(m, frequency_hz, m.hold),
                                                     m.n_outputs());
          },
          py::arg("frequency_hz"),
          "P(j omega) through the model's hold and delays, [N x n_y x n_u], unit of output over "
          "input")
      .def("modes", &modes_of,
           "natural_frequency_hz, damping_ratio, modal_mass, output_shape [n_y], input_shape [n_u]")
      .def(
          "state_space",
          [](const AdditiveModel& m) {
            const StateSpace s = state_space(m);
            return std::make_tuple(s.A, s.B, s.C, s.D);
          },
          "Continuous A, B, C, D without delays, rad/s")
      .def(
          "sampled_state_space",
          [](const AdditiveModel& m) {
            const SampledStateSpace s = sampled_state_space(m);
            return std::make_tuple(s.system.A, s.system.B, s.system.C, s.system.D,
                                   s.input_delay_samples, s.output_delay_samples);
          },
          "A, B, C, D behind a zero-order hold, and the delays of inputs [n_u] and outputs [n_y] "
          "in samples")
      .def(
          "save",
          [](const AdditiveModel& m, const std::filesystem::path& file) { write_model(file, m); },
          py::arg("file"), "Writes model.json, whole or not at all.");
}

}  // namespace

PYBIND11_MODULE(stageid, module) {
  module.doc() = "Measures and identifies multivariable motion stages in closed loop. SI units.";
  module.attr("__version__") = STAGEID_VERSION;
  module.def("multisine", &multisine, py::arg("sample_rate_hz"), py::arg("period_samples"),
             py::arg("low_hz"), py::arg("high_hz"), py::arg("rms"), py::arg("seed"),
             "One period of a flat random-phase multisine, [period_samples], unit of rms.");
  module.def("read_frf", &frf_as_dict, py::arg("file"),
             "frf.h5 as a dict: frequency_hz [N], response and variances [N x n_y x n_u] (None if "
             "unknown)");
  module.def(
      "read_log", &log_as_list, py::arg("file"),
      "The runs of a .slog or .h5 log: excitation [period x n_r], actuators [S x n_u], sensors "
      "[S x n_y]");
  module.def("read_model", &read_model, py::arg("file"), "model.json as a Model.");
  module.def(
      "call", &call,
      "Runs a command of the program in this process, call('fit', 'frf.h5', '-o', 'model.json'), "
      "and returns its exit code: 0, 3 or 4. Errors are raised: ValueError for a bad request, "
      "RuntimeError "
      "for files.");
  define_model(module);
}

}  // namespace stageid
