#pragma once

#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <cstdint>

namespace stageid {

// Array arguments: arrays of any order and type, or objects that numpy can convert to one. All functions throw
// pybind11::type_error "NAME: ..." for objects that are not numeric.

using RealArray = pybind11::array_t<double, pybind11::array::forcecast>;
using FlagArray = pybind11::array_t<std::uint8_t, pybind11::array::forcecast>;

/// Not copied if it is float64.
/// @throws std::invalid_argument "NAME: ..." for complex numbers, whose imaginary part numpy would drop
RealArray real_array(const pybind11::object& given, const char* name);

/// The same with one axis; a single number is a vector of length one.
/// @throws std::invalid_argument as real_array(), and for more axes
Eigen::VectorXd real_vector(const pybind11::object& given, const char* name);

/// 1 for nonzero numbers. A cast to uint8 would convert 256 and 0.5 to 0.
FlagArray flag_array(const pybind11::object& given, const char* name);

}  // namespace stageid
