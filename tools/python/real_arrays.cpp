#include "tools/python/real_arrays.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <string_view>

namespace stageid {
namespace {

namespace py = pybind11;

[[noreturn]] void refuse_type(const char* name) {
  throw py::type_error(fmt::format("{}: expected an array of numbers", name));
}

py::array number_array(const py::object& given, const char* name) {
  constexpr std::string_view kNumberKinds = "biufcO";  // objects: they may be numbers
  py::array array = py::array::ensure(given);
  if (!array || kNumberKinds.find(array.dtype().kind()) == std::string_view::npos)
    refuse_type(name);
  return array;
}

}  // namespace

RealArray real_array(const py::object& given, const char* name) {
  const py::array array = number_array(given, name);
  if (array.dtype().kind() == 'c')
    throw std::invalid_argument(fmt::format(
        "{}: contains complex numbers; expected real numbers. Give the real part if intended",
        name));
  RealArray reals = RealArray::ensure(array);
  if (!reals) refuse_type(name);
  return reals;
}

Eigen::VectorXd real_vector(const py::object& given, const char* name) {
  const RealArray array = real_array(given, name);
  const bool column = array.ndim() == 2 && array.shape(1) == 1;
  if (array.ndim() > 1 && !column)
    throw std::invalid_argument(fmt::format("{}: has {} axes; expected one", name, array.ndim()));
  const auto in_order = py::array_t<double, py::array::c_style | py::array::forcecast>(array);
  return Eigen::Map<const Eigen::VectorXd>(in_order.data(), in_order.size());
}

FlagArray flag_array(const py::object& given, const char* name) {
  FlagArray flags = FlagArray::ensure(number_array(given, name).attr("__ne__")(0));
  if (!flags) refuse_type(name);
  return flags;
}

}  // namespace stageid
