// The Python module: numpy in and out, every number from the functions that the program calls.

#include <string>
#include <vector>

#include "acquisition/files/version.hpp"
#include "tools/commands/program.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/interruptible.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

namespace py = pybind11;

int call(const py::args& arguments) {
  std::vector<std::string> words = {"stageid"};
  for (const py::handle& argument : arguments) words.push_back(py::str(argument));
  std::vector<const char*> pointers;
  for (const std::string& word : words) pointers.push_back(word.c_str());
  return interruptible(
      [&] { return run_program(static_cast<int>(pointers.size()), pointers.data()); });
}

}  // namespace

PYBIND11_MODULE(_native, module) {
  // Users see the package; this is where it is made.
  module.attr("__name__") = "stageid";
  module.doc() = "The compiled part of stageid.";
  module.attr("__version__") = version();
  define_errors(module);
  define_excitation(module);
  define_logs(module);
  define_frf(module);
  define_modes(module);
  define_model(module);
  define_fit(module);
  module.def("call", &call, docstring("call"));
  module.def("_docstring", &docstring);
  module.attr("__name__") = "stageid._native";
}

}  // namespace stageid
