#pragma once

#include <pybind11/complex.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/python/bindings.hpp"

namespace stageid {

// Results are objects of the classes in stageid/_results.py, with None for absent values.

/// An object of the class with that name, from its fields: result("Mode", "modal_mass"_a = 2.0, ...).
template <typename... Fields>
py::object result(const char* name, Fields&&... fields) {
  return py::module_::import("stageid._results").attr(name)(std::forward<Fields>(fields)...);
}

inline std::optional<double> unless_zero(double number) {
  return number != 0.0 ? std::optional(number) : std::nullopt;
}
inline std::optional<double> unless_nan(double number) {
  return std::isnan(number) ? std::nullopt : std::optional(number);
}
inline std::optional<std::string> unless_empty(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional(text);
}

inline py::array_t<double> array_of(const std::vector<double>& values) {
  return py::array_t<double>(std::ssize(values), values.data());
}
/// None for an empty array.
template <typename Values>
py::object array_unless_empty(const Values& values) {
  return values.size() > 0 ? py::cast(values) : py::none();
}

/// Columns that are vec of an n_y x n_u matrix, as a read-only array [N x n_y x n_u] over the same memory; `owner`
/// keeps the memory alive. None for an empty matrix.
template <typename Scalar>
py::object lines_view(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& columns,
                      Eigen::Index n_y, const py::handle& owner) {
  if (columns.size() == 0) return py::none();
  const auto bytes = static_cast<py::ssize_t>(sizeof(Scalar));
  py::array_t<Scalar> array({columns.cols(), n_y, columns.rows() / n_y},
                            {columns.rows() * bytes, bytes, n_y * bytes}, columns.data(), owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// The same for a matrix without another owner, which is moved into the array.
template <typename Scalar>
py::object lines_moved(Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>&& columns,
                       Eigen::Index n_y) {
  using Columns = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  auto kept = std::make_unique<Columns>(std::move(columns));
  Columns* memory = kept.get();
  const py::capsule owner(kept.release(), [](void* p) { delete static_cast<Columns*>(p); });
  return lines_view(*memory, n_y, owner);
}

}  // namespace stageid
