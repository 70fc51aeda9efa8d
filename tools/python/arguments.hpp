#pragma once

#include <pybind11/complex.h>
#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "tools/python/bindings.hpp"

namespace stageid {

// Array arguments: arrays of any order and type, or objects that numpy can convert to one. All functions throw
// py::type_error "NAME: ..." for objects that are not numeric.

using RealArray = py::array_t<double, py::array::forcecast>;
using FlagArray = py::array_t<std::uint8_t, py::array::forcecast>;

/// Not copied if it is float64.
/// @throws std::invalid_argument "NAME: ..." for complex numbers, whose imaginary part numpy would drop
RealArray real_array(const py::object& given, const char* name);

/// The same with one axis; a single number is a vector of length one.
/// @throws std::invalid_argument as real_array(), and for more axes
Eigen::VectorXd real_vector(const py::object& given, const char* name);

/// 1 for nonzero numbers. A cast to uint8 would convert 256 and 0.5 to 0.
FlagArray flag_array(const py::object& given, const char* name);

/// Columns that are vec of an n_y x n_u matrix, as a copy: Python arrays have any order, and the estimate owns its memory.
/// @throws std::invalid_argument "NAME: ..." unless the shape is N x n_y x n_u.
template <typename Scalar>
Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> columns_of(
    const py::array_t<Scalar, py::array::forcecast>& array, const char* name) {
  if (array.ndim() != 3)
    throw std::invalid_argument(std::string(name) + ": has " + std::to_string(array.ndim()) +
                                " axes; expected [lines x outputs x inputs]");
  const auto in = array.template unchecked<3>();
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> columns(in.shape(1) * in.shape(2),
                                                                in.shape(0));
  for (Eigen::Index k = 0; k < in.shape(0); ++k)
    for (Eigen::Index j = 0; j < in.shape(2); ++j)
      for (Eigen::Index i = 0; i < in.shape(1); ++i) columns(i + in.shape(1) * j, k) = in(k, i, j);
  return columns;
}

/// Names as arguments; None: not given.
using Names = std::optional<std::vector<std::string>>;
/// Units, one per channel; None: unknown.
using Units = std::vector<std::optional<std::string>>;

/// The names and units of `count` channels. Defaults: prefix1, prefix2, ..., and unknown units.
/// @throws std::invalid_argument "GROUP: ..." if names and units differ in number
ChannelList channels(const char* group, long count, const char* prefix, const Names& names,
                     const std::optional<Units>& units);

Units units_of(const ChannelList& channels);

}  // namespace stageid
