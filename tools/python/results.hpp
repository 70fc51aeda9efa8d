#pragma once

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace stageid {

// Results are objects of the classes in stageid/_results.py, with None for absent values.

/// An object of the class with that name, from its fields: result("Mode", "modal_mass"_a = 2.0, ...).
template <typename... Fields>
pybind11::object result(const char* name, Fields&&... fields) {
  return pybind11::module_::import("stageid._results").attr(name)(std::forward<Fields>(fields)...);
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

inline pybind11::array_t<double> array_of(const std::vector<double>& values) {
  return pybind11::array_t<double>(static_cast<pybind11::ssize_t>(values.size()), values.data());
}
/// None for an empty array.
template <typename Values>
pybind11::object array_unless_empty(const Values& values) {
  return values.size() > 0 ? pybind11::cast(values) : pybind11::none();
}

}  // namespace stageid
