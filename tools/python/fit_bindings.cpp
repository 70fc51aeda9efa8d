#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <memory>
#include <utility>

#include "tools/fit/fit_flags.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"
#include "tools/python/interruptible.hpp"
#include "tools/python/numpy_arrays.hpp"
#include "tools/python/pickles.hpp"
#include "tools/steps/covariance_file.hpp"
#include "tools/steps/fit_step.hpp"

namespace stageid {
namespace {

namespace py = pybind11;

/// A value as the flag of the program takes it: None is silent, a list becomes "f1,f2,...". repr() of a
/// float gives back the same float. Arrays of numpy are lists, its scalars numbers.
std::string flag_text(const py::object& value) {
  if (value.is_none()) return "";
  if (py::isinstance<py::str>(value) || py::isinstance<py::int_>(value)) return py::str(value);
  if (py::hasattr(value, "tolist")) return flag_text(value.attr("tolist")());
  if (!py::isinstance<py::sequence>(value))
    return py::hasattr(value, "__fspath__") ? py::str(value) : py::str(py::repr(py::float_(value)));
  std::string text;
  for (const py::handle& item : value)
    text += (text.empty() ? "" : ",") +
            std::string(py::str(py::repr(py::float_(py::reinterpret_borrow<py::object>(item)))));
  return text;
}

std::shared_ptr<FrfHandle> frf_of(const py::object& given) {
  if (py::isinstance<FrfHandle>(given)) return given.cast<std::shared_ptr<FrfHandle>>();
  try {
    return std::make_shared<FrfHandle>(read_frf_handle(given.cast<std::filesystem::path>()));
  } catch (const py::cast_error&) {
    throw py::type_error("frf: expected an Frf or a file name");
  }
}

FitResult fit(const py::object& given, std::optional<std::array<double, 2>> band_hz,
              const py::object& modes, const py::object& weighting, const std::string& hold,
              const py::object& delay, const py::object& rigid_body, const py::object& residue_rank,
              const std::string& damping, const std::string& direct_term,
              const std::vector<std::string>& submodels, const std::string& method,
              int max_iterations, double search_seconds, int threads, bool covariance) {
  FitFlags flags;
  flags.modes = flag_text(modes);
  flags.weighting = flag_text(weighting);
  flags.hold = hold;
  flags.delay = flag_text(delay);
  flags.rigid_body = flag_text(rigid_body);
  flags.residue_rank = flag_text(residue_rank);
  flags.damping = damping;
  flags.direct_term = direct_term;
  flags.submodels = submodels;
  flags.method = method;
  FitRequest request;
  request.band_hz = band_hz;
  parse_fit_flags(flags, request);
  request.max_iterations = max_iterations;
  request.search_seconds = search_seconds;
  request.threads = threads;
  const std::shared_ptr<FrfHandle> of = frf_of(given);
  Console silent;
  silent.verbosity = Verbosity::quiet;
  return interruptible([&] {
    const std::string fingerprint =
        of->fingerprint.empty() ? fingerprint_of_content(of->frf) : of->fingerprint;
    FitSetup setup = make_fit_setup(request, of->frf);
    setup.options.covariance = covariance;
    return fit_with_progress(setup, of->name, fingerprint, silent).result;
  });
}

constexpr const char* kFitDoc =
    R"(Fits the additive model P(s) = sum of modes and rigid body to a frequency response, like `stageid fit`.

frf               an Frf or a file name
band_hz           (low, high) in Hz; None: all lines
modes             'auto', 'none', the number of modes, a list of frequencies in Hz, or the name of a modes.json
weighting         'unit', 'inverse_magnitude', 'relative', 'noise_variance', 'total_variance', 'likelihood',
                  or the name of an HDF5 file with /weights; None: according to the variances of the response
hold              'none', 'phase', 'sinc', 'exact'; '': according to the response
delay             in s, 'estimate' or 'per_channel'; None: according to the response
rigid_body        'none', 'full', a rank, 'suspension' or 'suspension:F1:F2' (Hz);
                  None: according to the unit of the outputs, full by default
residue_rank      residue rank of the modes: 'full' or 1
damping           'proportional' (B_0) or 'general' (B_0 + B_1 s); '': according to the unit of the outputs
direct_term       'none' or 'full'; '': according to the unit of the outputs
submodels         additional submodels in the form of --submodel, e.g. 'n=4,m=3,f=120:180'
method            'riv', 'gn' or 'sk'; max_iterations is the limit per fit
search_seconds    budget of the search for modes, in seconds of a typical core (counted as work); 0: unlimited
threads           0: all cores; the result does not depend on it
covariance        True: also compute Fit.covariance (at most 4000 parameters)

Returns a Fit. A fit that does not converge raises no error: check trustworthy. Releases the GIL; Ctrl-C interrupts it.
Raises RequestError, FormatError, FileError.)";

py::object covariance_of(const py::object& self) {
  const auto& r = self.cast<const FitResult&>();
  if (r.covariance.sandwich.size() == 0) return py::none();
  const ParameterNames parameters = parameter_names(r);
  const Eigen::Index n_y = r.model.n_outputs();
  py::dict out;
  out["name"] = parameters.names;
  out["unit"] = parameters.units;
  out["value"] = Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(
      parameters.values.data(), static_cast<Eigen::Index>(parameters.values.size())));
  out["sandwich"] = r.covariance.sandwich;
  out["likelihood"] = r.covariance.likelihood;
  out["response_variance"] = lines_view<double>(r.covariance.response_variance, n_y, self);
  out["confidence_radius"] = lines_view<double>(r.covariance.response_radius, n_y, self);
  return out;
}

constexpr const char* kCovarianceDoc =
    R"(A dict: name, unit and value of all p parameters; sandwich and likelihood, two estimates of their covariance
[p, p]; response_variance and confidence_radius (95 %) of the model on the fitted lines, float64 [N, n_y, n_u]. The
same as `stageid fit --covariance` writes. None unless requested with fit(..., covariance=True).)";

constexpr const char* kVarianceDoc =
    R"(E|dP|^2 of the model's response on the fitted lines, float64 [N, n_y, n_u]; None without variances.

A read-only view, not copied.)";

}  // namespace

void define_fit(py::module_& module) {
  py::class_<FitResult, std::shared_ptr<FitResult>>(
      module, "Fit",
      "The result of a fit: the model, the decisions on the way, and whether it is trustworthy.")
      .def_property_readonly(
          "model", [](const FitResult& r) { return r.model; }, "The fitted Model (a copy)")
      .def_property_readonly(
          "trustworthy", [](const FitResult& r) { return r.trustworthy(); },
          "False if `stageid fit` would end with exit code 3")
      .def_property_readonly(
          "status", [](const FitResult& r) { return to_string(r.status); },
          "'gradient_small', 'step_small', or the reason why the fit is not trustworthy")
      .def_readonly("message", &FitResult::message, "How the fit ended, in one line")
      .def_readonly("cost", &FitResult::cost,
                    "Cost 1/(2N) sum vec(E)^H W vec(E) per iteration, from the start on")
      .def_readonly("decisions", &FitResult::decisions,
                    "What was chosen and why, one line per decision")
      .def_readonly("removal_cost", &FitResult::removal_cost,
                    "Increase of sum W |E|^2 without each submodel")
      .def_property_readonly(
          "response_variance",
          [](const py::object& self) {
            const auto& r = self.cast<const FitResult&>();
            return lines_view<double>(r.response_variance, r.model.n_outputs(), self);
          },
          kVarianceDoc)
      .def_property_readonly("covariance", &covariance_of, kCovarianceDoc)
      .def(py::pickle([](const FitResult& r) { return state_of(r); }, &fit_of_state));
  module.def("fit", &fit, py::arg("frf"), py::kw_only(), py::arg("band_hz") = py::none(),
             py::arg("modes") = py::none(), py::arg("weighting") = py::none(), py::arg("hold") = "",
             py::arg("delay") = py::none(), py::arg("rigid_body") = py::none(),
             py::arg("residue_rank") = "full", py::arg("damping") = "", py::arg("direct_term") = "",
             py::arg("submodels") = std::vector<std::string>{}, py::arg("method") = "riv",
             py::arg("max_iterations") = 100, py::arg("search_seconds") = 180.0,
             py::arg("threads") = 0, py::arg("covariance") = false, kFitDoc);
}

}  // namespace stageid
