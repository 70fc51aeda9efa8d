#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "estimation/model/cmif.hpp"
#include "estimation/start/stabilization.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"
#include "tools/python/interruptible.hpp"

namespace stageid {
namespace {

namespace py = pybind11;

CmifKind kind_of(const std::string& name) {
  return pick<CmifKind>("kind", name, {"response", "accelerance", "whitened"});
}

py::list modes(const FrfHandle& of, const std::string& kind, double prominence_db) {
  PeakOptions options;
  options.kind = kind_of(kind);
  options.minimum_prominence_db = prominence_db;
  py::list list;
  for (const ModeCandidate& candidate : pick_modes(of.frf, options)) {
    py::dict mode;
    mode["frequency_hz"] = candidate.frequency_hz;
    mode["damping_ratio"] = candidate.damping_ratio;
    mode["cmif_curve"] = candidate.cmif_curve;
    list.append(mode);
  }
  return list;
}

py::list poles_over_orders(const FrfHandle& of, int most_order, double delay_s) {
  StabilizationOptions options;
  options.most_order = most_order;
  options.delay_s = delay_s;
  const auto found = interruptible([&] { return stabilization(of.frf, options); });
  py::list list;
  for (const StabilizationPole& pole : found) {
    py::dict entry;
    entry["order"] = pole.order;
    entry["frequency_hz"] = pole.frequency_hz;
    entry["damping_ratio"] = pole.damping_ratio;
    entry["stable_frequency"] = pole.stable_frequency;
    entry["stable_damping"] = pole.stable_damping;
    list.append(entry);
  }
  return list;
}

constexpr const char* kModesDoc =
    R"(Candidate modes in order of frequency: prominent peaks of the mode indicator, without crossings of its curves.

kind            basis of the indicator: 'accelerance', 'response' or 'whitened' (by the variances)
prominence_db   least prominence of a peak, in dB

Returns a list of dicts: frequency_hz, damping_ratio, cmif_curve (from 1). Raises RequestError.)";

constexpr const char* kCmifDoc =
    R"(Complex mode indicator function: squared singular values of G(j omega_k), float64 [min(n_y, n_u), N].

kind is 'response', 'accelerance' (omega^2 G) or 'whitened'. The unit is that of the response squared; the largest
value is first. Raises RequestError for 'whitened' if the response has no variances.)";

constexpr const char* kStabilizationDoc =
    R"(Poles for the orders 2, 4, ... most_order by least squares in the z plane: an independent check of the modes.

delay_s, in s, is compensated first. Returns a list of dicts: order, frequency_hz, damping_ratio,
stable_frequency, stable_damping. Raises RequestError if there are too few lines.)";

}  // namespace

void define_modes(py::module_& module) {
  module.def("modes", &modes, py::arg("frf"), py::kw_only(), py::arg("kind") = "accelerance",
             py::arg("prominence_db") = PeakOptions{}.minimum_prominence_db, kModesDoc);
  module.def(
      "cmif",
      [](const FrfHandle& of, const std::string& kind) { return cmif(of.frf, kind_of(kind)); },
      py::arg("frf"), py::kw_only(), py::arg("kind") = "response", kCmifDoc);
  module.def("stabilization", &poles_over_orders, py::arg("frf"), py::kw_only(),
             py::arg("most_order") = StabilizationOptions{}.most_order, py::arg("delay_s") = 0.0,
             kStabilizationDoc);
}

}  // namespace stageid
