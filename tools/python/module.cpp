// The Python module: numpy in and out, every number from the functions that the program calls.

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <string>
#include <vector>

#include "acquisition/files/version.hpp"
#include "excitation/multisine/multisine.hpp"
#include "tools/commands/program.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/python/arguments.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/interruptible.hpp"

namespace stageid {
namespace {

int call(const py::args& arguments) {
  std::vector<std::string> words = {"stageid"};
  for (const py::handle& argument : arguments) words.push_back(py::str(argument));
  std::vector<const char*> pointers;
  for (const std::string& word : words) pointers.push_back(word.c_str());
  return interruptible(
      [&] { return run_program(static_cast<int>(pointers.size()), pointers.data()); });
}

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

PYBIND11_MODULE(_native, module) {
  // Users see the package; this is where it is made.
  module.attr("__name__") = "stageid";
  module.doc() = "The compiled part of stageid.";
  module.attr("__version__") = version();
  define_errors(module);
  define_logs(module);
  define_frf(module);
  define_model(module);
  define_fit(module);
  module.def("call", &call, docstring("call"));
  module.def("multisine", &multisine, "sample_rate_hz"_a, "period_samples"_a, "low_hz"_a,
             "high_hz"_a, "rms"_a, "seed"_a, py::kw_only(), "lines"_a = "all",
             "shape"_a = py::none(), "crest_iterations"_a = 0, docstring("multisine"));
  module.def("_docstring", &docstring);
  module.attr("__name__") = "stageid._native";
}

}  // namespace stageid
