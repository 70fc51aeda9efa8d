#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "excitation/multisine/multisine.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/real_arrays.hpp"

namespace stageid {
namespace {

namespace py = pybind11;

Eigen::VectorXd multisine(double sample_rate_hz, int period_samples, double low_hz, double high_hz,
                          double rms, std::uint64_t seed, const std::string& lines,
                          const py::object& shape, int crest_iterations) {
  const LineSpec band{
      .low_hz = low_hz,
      .high_hz = high_hz,
      .selection = pick<LineSelection>("lines", lines, {"all", "odd", "odd_random"}),
      .seed = seed};
  MultisineSpec spec;
  spec.level = rms;
  spec.seed = seed;
  spec.crest_iterations = crest_iterations;
  if (!shape.is_none()) spec.shape = real_vector(shape, "shape");
  return random_phase_multisine(FrequencyGrid::band(sample_rate_hz, period_samples, band), spec)
      .samples;
}

constexpr const char* kMultisine =
    R"(One period of a random-phase multisine, x(n) = sum_k A_k cos(2 pi l_k n / N + phi_k).

sample_rate_hz, low_hz, high_hz   Hz; the band is inclusive
period_samples                    N
rms                               RMS value of the samples, in the unit of the result
seed                              the same seed gives the same signal on every machine
lines                             'all', 'odd' or 'odd_random'
shape [lines]                     relative amplitude per line; None: flat
crest_iterations                  number of clipping iterations that lower the crest factor; 0: none

Returns float64 [period_samples], not copied. Raises RequestError.)";

}  // namespace

void define_excitation(py::module_& module) {
  module.def("multisine", &multisine, py::arg("sample_rate_hz"), py::arg("period_samples"),
             py::arg("low_hz"), py::arg("high_hz"), py::arg("rms"), py::arg("seed"), py::kw_only(),
             py::arg("lines") = "all", py::arg("shape") = py::none(),
             py::arg("crest_iterations") = 0, kMultisine);
}

}  // namespace stageid
