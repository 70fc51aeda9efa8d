#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <cstddef>
#include <memory>
#include <string>

#include "acquisition/files/fingerprint.hpp"
#include "estimation/model/cmif.hpp"
#include "estimation/start/stabilization.hpp"
#include "tools/exchange/model/covariance_file.hpp"
#include "tools/fit/fit_words.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"
#include "tools/python/interruptible.hpp"
#include "tools/python/pickles.hpp"
#include "tools/python/results.hpp"
#include "tools/steps/fit_step.hpp"

namespace stageid {
namespace {

py::list candidate_modes(const FrfHandle& of, const std::string& kind, double prominence_db) {
  PeakOptions options;
  options.kind = pick<CmifKind>("kind", kind);
  options.minimum_prominence_db = prominence_db;
  py::list list;
  for (const ModeCandidate& candidate : pick_modes(of.frf, options))
    list.append(result("CandidateMode", "frequency_hz"_a = candidate.frequency_hz,
                       "damping_ratio"_a = candidate.damping_ratio,
                       "cmif_curve"_a = candidate.cmif_curve));
  return list;
}

py::list poles_over_orders(const FrfHandle& of, int most_order, double delay_s) {
  StabilizationOptions options;
  options.most_order = most_order;
  options.delay_s = delay_s;
  const auto found = interruptible([&] { return stabilization(of.frf, options); });
  py::list list;
  for (const StabilizationPole& pole : found)
    list.append(result("StabilizationPole", "order"_a = pole.order,
                       "frequency_hz"_a = pole.frequency_hz, "damping_ratio"_a = pole.damping_ratio,
                       "stable_frequency"_a = pole.stable_frequency,
                       "stable_damping"_a = pole.stable_damping));
  return list;
}

using Word = std::optional<std::string>;

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

/// Identifies the content of a response without a file: frequencies, response and variances.
std::string fingerprint_of_content(const FrfEstimate& frf) {
  Fingerprint fingerprint;
  const auto add = [&](const auto& matrix) {
    fingerprint.add({reinterpret_cast<const std::byte*>(matrix.data()),
                     static_cast<std::size_t>(matrix.size()) * sizeof(*matrix.data())});
  };
  add(frf.frequency_hz);
  add(frf.response);
  add(frf.noise_variance);
  add(frf.total_variance);
  return fingerprint.hex();
}

FitResult fit(const py::object& given, std::optional<std::array<double, 2>> band_hz,
              const py::object& modes, const py::object& weighting, const Word& hold,
              const py::object& delay, const py::object& rigid_body, const py::object& residue_rank,
              const Word& damping, const Word& direct_term,
              const std::optional<std::vector<std::string>>& submodels, const std::string& method,
              int max_iterations, std::optional<double> search_seconds, std::optional<int> threads,
              bool covariance) {
  FitWords flags;
  flags.modes = flag_text(modes);
  flags.weighting = flag_text(weighting);
  flags.hold = hold.value_or("");
  flags.delay = flag_text(delay);
  flags.rigid_body = flag_text(rigid_body);
  flags.residue_rank = flag_text(residue_rank);
  flags.damping = damping.value_or("");
  flags.direct_term = direct_term.value_or("");
  if (submodels) flags.submodels = *submodels;
  flags.method = method;
  FitRequest request;
  request.band_hz = band_hz;
  parse_fit_words(flags, request);
  request.max_iterations = max_iterations;
  request.search_seconds = search_seconds.value_or(0.0);
  request.threads = threads.value_or(0);
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

py::object covariance_of(const py::object& self) {
  const auto& r = self.cast<const FitResult&>();
  if (r.covariance.sandwich.size() == 0) return py::none();
  const NamedParameters parameters = named_parameters(r.model, r.covariance.sandwich.rows());
  const Eigen::Index n_y = r.model.n_outputs();
  const auto lines = [&](const Eigen::MatrixXd& columns) {
    return lines_view<double>(columns, n_y, self);
  };
  return result("Covariance", "name"_a = parameters.names, "unit"_a = parameters.units,
                "value"_a = array_of(parameters.values), "sandwich"_a = r.covariance.sandwich,
                "likelihood"_a = r.covariance.likelihood,
                "response_variance"_a = lines(r.covariance.response_variance),
                "confidence_radius"_a = lines(r.covariance.response_radius));
}

}  // namespace

void define_fit(py::module_& module) {
  module.def("modes", &candidate_modes, "frf"_a, py::kw_only(), "kind"_a = "accelerance",
             "prominence_db"_a = PeakOptions{}.minimum_prominence_db, docstring("modes"));
  module.def(
      "cmif",
      [](const FrfHandle& of, const std::string& kind) {
        return cmif(of.frf, pick<CmifKind>("kind", kind));
      },
      "frf"_a, py::kw_only(), "kind"_a = "response", docstring("cmif"));
  module.def("stabilization", &poles_over_orders, "frf"_a, py::kw_only(),
             "most_order"_a = StabilizationOptions{}.most_order, "delay_s"_a = 0.0,
             docstring("stabilization"));
  py::class_<FitResult, std::shared_ptr<FitResult>> c(module, "Fit", docstring("Fit"));
  c.def(py::pickle([](const FitResult& r) { return state_of(r); }, &fit_of_state));
  const auto property = [&](const char* name, auto get) {
    c.def_property_readonly(name, get, docstring(std::string("Fit.") + name));
  };
  property("model", [](const FitResult& r) { return r.model; });
  property("trustworthy", [](const FitResult& r) { return r.trustworthy(); });
  property("status", [](const FitResult& r) { return to_string(r.status()); });
  property("message", [](const FitResult& r) { return unless_empty(r.message()); });
  property("cost", [](const FitResult& r) { return r.cost; });
  property("decisions", [](const FitResult& r) { return r.decisions; });
  property("removal_cost", [](const FitResult& r) { return r.removal_cost; });
  property("response_variance", [](const py::object& self) {
    const auto& r = self.cast<const FitResult&>();
    return lines_view<double>(r.response_variance, r.model.n_outputs(), self);
  });
  property("covariance", &covariance_of);
  const FitRequest defaults;
  module.def("fit", &fit, "frf"_a, py::kw_only(), "band_hz"_a = py::none(), "modes"_a = py::none(),
             "weighting"_a = py::none(), "hold"_a = py::none(), "delay"_a = py::none(),
             "rigid_body"_a = py::none(), "residue_rank"_a = "full", "damping"_a = py::none(),
             "direct_term"_a = py::none(), "submodels"_a = py::none(), "method"_a = "riv",
             "max_iterations"_a = defaults.max_iterations,
             "search_seconds"_a = defaults.search_seconds, "threads"_a = py::none(),
             "covariance"_a = false, docstring("fit"));
}

}  // namespace stageid
