#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "excitation/multisine/multisine.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/python/arguments.hpp"
#include "tools/python/bindings.hpp"

namespace stageid {
namespace {

namespace py = pybind11;
using py::literals::operator""_a;

Eigen::VectorXd multisine(double sample_rate_hz, int period_samples, double low_hz, double high_hz,
                          double rms, std::uint64_t seed, const std::string& lines,
                          const py::object& shape, int crest_iterations) {
  const LineSpec band{.low_hz = low_hz,
                      .high_hz = high_hz,
                      .selection = pick<LineSelection>("lines", lines),
                      .seed = seed};
  MultisineSpec spec;
  spec.level = rms;
  spec.seed = seed;
  spec.crest_iterations = crest_iterations;
  if (!shape.is_none()) spec.shape = real_vector(shape, "shape");
  return random_phase_multisine(FrequencyGrid::band(sample_rate_hz, period_samples, band), spec)
      .samples;
}

}  // namespace

void define_excitation(py::module_& module) {
  module.def("multisine", &multisine, "sample_rate_hz"_a, "period_samples"_a, "low_hz"_a,
             "high_hz"_a, "rms"_a, "seed"_a, py::kw_only(), "lines"_a = "all",
             "shape"_a = py::none(), "crest_iterations"_a = 0, docstring("multisine"));
}

}  // namespace stageid
