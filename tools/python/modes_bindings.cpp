#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "estimation/model/cmif.hpp"
#include "estimation/start/stabilization.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"
#include "tools/python/interruptible.hpp"
#include "tools/python/results.hpp"

namespace stageid {
namespace {

namespace py = pybind11;
using py::literals::operator""_a;

py::list modes(const FrfHandle& of, const std::string& kind, double prominence_db) {
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

}  // namespace

void define_modes(py::module_& module) {
  module.def("modes", &modes, "frf"_a, py::kw_only(), "kind"_a = "accelerance",
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
}

}  // namespace stageid
