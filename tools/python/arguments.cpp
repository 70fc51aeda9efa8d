#include "tools/python/arguments.hpp"

#include <fmt/format.h>

#include <string_view>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

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
    fail_request(
        "{}: contains complex numbers; expected real numbers. Give the real part if intended",
        name);
  RealArray reals = RealArray::ensure(array);
  if (!reals) refuse_type(name);
  return reals;
}

Eigen::VectorXd real_vector(const py::object& given, const char* name) {
  const RealArray array = real_array(given, name);
  const bool column = array.ndim() == 2 && array.shape(1) == 1;
  if (array.ndim() > 1 && !column)
    fail_request("{}: has {} axes; expected one", name, array.ndim());
  const auto in_order = py::array_t<double, py::array::c_style | py::array::forcecast>(array);
  return Eigen::Map<const Eigen::VectorXd>(in_order.data(), in_order.size());
}

FlagArray flag_array(const py::object& given, const char* name) {
  FlagArray flags = FlagArray::ensure(number_array(given, name).attr("__ne__")(0));
  if (!flags) refuse_type(name);
  return flags;
}

ChannelList channels(const char* group, long count, const char* prefix, const Names& names,
                     const std::optional<Units>& units) {
  ChannelList list;
  if (names) list.names = *names;
  if (!names)
    for (long c = 1; c <= count; ++c) list.names.push_back(fmt::format("{}{}", prefix, c));
  list.units.resize(list.size());
  if (!units) return list;
  if (units->size() != list.size())
    fail_request("{}: {} for {}; give one per channel", group, counted(units->size(), "unit"),
                 counted(list.size(), "channel"));
  for (std::size_t c = 0; c < list.size(); ++c) list.units[c] = (*units)[c].value_or("");
  return list;
}

Units units_of(const ChannelList& channels) {
  Units units(channels.size());
  for (std::size_t c = 0; c < channels.units.size() && c < units.size(); ++c)
    if (!channels.units[c].empty()) units[c] = channels.units[c];
  return units;
}

}  // namespace stageid
