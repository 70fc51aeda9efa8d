#pragma once

#include <pybind11/numpy.h>

#include <memory>

#include "acquisition/record/log_reader.hpp"
#include "estimation/problem/fit_options.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"

namespace stageid {

// The pickled state of the objects of the module: bytes and plain Python objects. The bytes are those of frf.h5 and
// model.json, so that every number is restored exactly.

py::tuple state_of(const FrfHandle& frf);
FrfHandle frf_of_state(const py::tuple& state);

py::bytes state_of(const AdditiveModel& model);
AdditiveModel model_of_state(const py::bytes& state);

py::tuple state_of(const FitResult& fit);
FitResult fit_of_state(const py::tuple& state);

/// For a log in memory its arrays, for a log in a file the absolute path of the file, which is opened again.
py::tuple state_of(const LogReader& log);
std::shared_ptr<LogReader> log_of_state(const py::tuple& state);

}  // namespace stageid
