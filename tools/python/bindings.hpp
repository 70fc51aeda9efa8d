#pragma once

#include <pybind11/pybind11.h>

namespace stageid {

// The parts of the module, by source file.

void define_errors(pybind11::module_& module);      ///< errors.cpp
void define_excitation(pybind11::module_& module);  ///< excitation_bindings.cpp
void define_logs(pybind11::module_& module);        ///< log_bindings.cpp
void define_frf(pybind11::module_& module);         ///< frf_bindings.cpp
void define_modes(pybind11::module_& module);       ///< modes_bindings.cpp; after define_frf()
void define_model(pybind11::module_& module);       ///< model_bindings.cpp; after define_frf()
void define_fit(pybind11::module_& module);         ///< fit_bindings.cpp; after define_model()

}  // namespace stageid
