#pragma once

#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <cstdint>

namespace stageid {

// Arguments that are arrays, as Python gives them: an array of any order and type, or what numpy makes
// one of. All throw pybind11::type_error "NAME: ..." for what holds no numbers.

using RealArray = pybind11::array_t<double, pybind11::array::forcecast>;
using FlagArray = pybind11::array_t<std::uint8_t, pybind11::array::forcecast>;

/// Not copied if it is float64.
/// @throws std::invalid_argument "NAME: ..." for complex numbers: numpy would drop their imaginary part
RealArray real_array(const pybind11::object& given, const char* name);

/// The same of one axis; one number is a vector of one.
/// @throws std::invalid_argument as real_array(), and for more axes
Eigen::VectorXd real_vector(const pybind11::object& given, const char* name);

/// 1 where the number is not 0. A cast to uint8 would make 256 and 0.5 a 0.
FlagArray flag_array(const pybind11::object& given, const char* name);

}  // namespace stageid
