#pragma once

#include <pybind11/numpy.h>

#include <memory>

#include "acquisition/record/log_reader.hpp"
#include "estimation/problem/fit_options.hpp"
#include "tools/python/frf_handle.hpp"

namespace stageid {

// What objects of the module are made of when they are pickled or copied. States are bytes and plain Python
// objects; the bytes are those of frf.h5 and model.json, so that every number comes back to the bit.

pybind11::tuple state_of(const FrfHandle& frf);
FrfHandle frf_of_state(const pybind11::tuple& state);

pybind11::bytes state_of(const AdditiveModel& model);
AdditiveModel model_of_state(const pybind11::bytes& state);

pybind11::tuple state_of(const FitResult& fit);
FitResult fit_of_state(const pybind11::tuple& state);

/// A log in memory is its arrays, a log in a file is the file's absolute name: it is opened again.
pybind11::tuple state_of(const LogReader& log);
std::shared_ptr<LogReader> log_of_state(const pybind11::tuple& state);

}  // namespace stageid
