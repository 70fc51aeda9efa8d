#include "tools/exchange/import/import_signals.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>
#include <stdexcept>

#include "acquisition/files/counted.hpp"
#include "tools/exchange/import/si_unit.hpp"

namespace stageid {
namespace {

std::string with_slashes(std::string name) {
  if (name.starts_with('/')) name.erase(0, 1);
  return name;
}

/// The array with this name, which may be a pattern.
const NamedArray& array_of(const ArrayList& arrays, const ImportMap& map, const std::string& name,
                           const RunNumbers& wanted) {
  if (!is_pattern(name)) return arrays.at(name);
  for (const auto& [numbers, found] : matches_of(with_slashes(name), arrays.names())) {
    // A name with one placeholder is shared by all runs with that number.
    const bool same = (!numbers.realization || numbers.realization == wanted.realization) &&
                      (!numbers.experiment || numbers.experiment == wanted.experiment);
    if (same) return arrays.at(found);
  }
  const auto number = [](const char* key, const std::optional<long long>& value) {
    return value ? fmt::format(" {} {}", key, *value) : std::string();
  };
  arrays.fail("", "has no '{}' of{}{}, which '{}' requires. Add it, or correct the pattern in {}",
              name, number("realization", wanted.realization),
              number("experiment", wanted.experiment), name, map.file.string());
}

/// Extent and step of every declared axis.
struct Axis {
  std::size_t extent = 1, step = 0;
};

/// The axes of `array` in the order of the map's `axes`.
std::vector<Axis> axes_of(const ArrayList& arrays, const NamedArray& array,
                          const std::vector<std::string>& names) {
  std::vector<std::size_t> shape = array.shape;
  if (names.size() == 1 && array.is_vector()) shape = {array.size()};
  while (shape.size() < names.size()) shape.push_back(1);  // MATLAB drops trailing ones
  while (shape.size() > names.size() && shape.back() == 1) shape.pop_back();
  if (shape.size() != names.size())
    arrays.fail(array.name, "has the shape {}; axes: [{}] lists {}. List every axis",
                fmt::join(array.shape, " x "), fmt::join(names, ", "),
                counted(names.size(), "axis", "axes"));
  std::vector<Axis> axes(shape.size());
  std::size_t step = 1;
  for (std::size_t q = shape.size(); q-- > 0; step *= shape[q]) axes[q] = {shape[q], step};
  return axes;
}

/// Without `axes`: samples x channels; both rows and columns of MATLAB are vectors.
SampleRows plain_samples(const ArrayList& arrays, const NamedArray& array, const char* key) {
  if (array.shape.size() > 2)
    arrays.fail(array.name,
                "has the shape {}. List its axes in the map: {}: {{arrays: [{}], "
                "axes: [sample, channel, run]}}, in their order; allowed are "
                "sample, channel, realization, experiment and run",
                fmt::join(array.shape, " x "), key, array.name);
  const std::vector<double>& values = real_values(arrays, array);
  const bool vector = array.shape.size() < 2 || array.shape[0] == 1;
  const auto rows = static_cast<Eigen::Index>(vector ? values.size() : array.shape[0]);
  if (rows == 0) arrays.fail(array.name, "is empty; expected samples");
  return Eigen::Map<const SampleRows>(values.data(), rows, std::ssize(values) / rows);
}

SampleRows samples_of(const ArrayList& arrays, const NamedArray& array,
                      const std::vector<std::string>& names, const char* key,
                      const RunPlace& place) {
  if (names.empty()) return plain_samples(arrays, array, key);
  const std::vector<double>& values = real_values(arrays, array);
  const std::vector<Axis> axes = axes_of(arrays, array, names);
  Axis sample, channel;
  std::size_t first = 0;
  for (std::size_t q = 0; q < names.size(); ++q) {
    if (names[q] == "sample")
      sample = axes[q];
    else if (names[q] == "channel")
      channel = axes[q];
    else
      first += axes[q].step * place.indices.at(names[q]);
  }
  if (values.empty()) arrays.fail(array.name, "is empty; expected samples");
  using Steps = Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>;
  const auto index = [](std::size_t value) { return static_cast<Eigen::Index>(value); };
  return Eigen::Map<const SampleRows, 0, Steps>(values.data() + first, index(sample.extent),
                                                index(channel.extent),
                                                Steps(index(sample.step), index(channel.step)));
}

void name_channels(const ImportMap& map, const char* key, const ImportMap::Signals& group,
                   SignalGroup& out, std::vector<std::string>& notes) {
  const auto count = static_cast<std::size_t>(out.samples.cols());
  if (!group.names.empty()) out.channels.names = group.names;
  if (out.channels.names.size() != count)
    refuse_map(map, "{}: got {} for {}; write names: [...]", key,
               counted(out.channels.names.size(), "name"), counted(count, "channel"));
  out.channels.units = units_of(map, key, group.unit, count);
  if (!group.scale.empty() && group.scale.size() != count)
    refuse_map(map, "{}: got {} for {}; write one per channel", key,
               counted(group.scale.size(), "scale"), counted(count, "channel"));
  std::vector<double> factors;
  try {
    factors = take_si_units(key, out.channels, notes);
  } catch (const std::invalid_argument& error) {
    refuse_map(map, "{}", error.what());
  }
  for (std::size_t c = 0; c < count; ++c) {
    const double factor = factors[c] * (group.scale.empty() ? 1.0 : group.scale[c]);
    if (factor != 1.0) out.samples.col(c) *= factor;
  }
}

}  // namespace

RunAxes run_axes_of(const ArrayList& arrays, const ImportMap& map) {
  RunAxes out;
  for (const auto& [key, group] : map.groups())
    for (const std::string& name : group->arrays) {
      if (group->axes.empty()) break;
      const RunNumbers first = name_numbers_of(arrays, map).front();
      const NamedArray& array = array_of(arrays, map, name, first);
      const std::vector<Axis> axes = axes_of(arrays, array, group->axes);
      for (std::size_t q = 0; q < axes.size(); ++q) {
        const std::string& axis = group->axes[q];
        if (axis == "sample" || axis == "channel") continue;
        const std::size_t known = out.emplace(axis, axes[q].extent).first->second;
        if (known != axes[q].extent)
          arrays.fail(array.name,
                      "has {} along axis {}; another array has {}. The numbers must be equal",
                      axes[q].extent, axis, known);
      }
    }
  return out;
}

std::vector<RunNumbers> name_numbers_of(const ArrayList& arrays, const ImportMap& map) {
  std::set<RunNumbers> numbers;
  bool patterns = false;
  for (const ImportMap::Signals* group : {&map.sensors, &map.actuators})
    for (const std::string& name : group->arrays) {
      if (!is_pattern(name)) continue;
      patterns = true;
      const auto found = matches_of(with_slashes(name), arrays.names());
      if (found.empty()) (void)arrays.at(name);  // throws an error that lists the available names
      if (numbers.empty())
        for (const auto& [run, text] : found) numbers.insert(run);
    }
  if (!patterns) return {RunNumbers{}};
  return {numbers.begin(), numbers.end()};
}

SignalGroup read_signals(const ArrayList& arrays, const ImportMap& map, const char* key,
                         const ImportMap::Signals& group, const RunPlace& place,
                         std::vector<std::string>& notes) {
  SignalGroup out;
  for (const std::string& name : group.arrays) {
    const NamedArray& array = array_of(arrays, map, name, place.names);
    const SampleRows columns = samples_of(arrays, array, group.axes, key, place);
    if (out.samples.cols() > 0 && columns.rows() != out.samples.rows())
      arrays.fail(array.name, "has {} samples; '{}' has {}", columns.rows(), group.arrays.front(),
                  out.samples.rows());
    const Eigen::Index first = out.samples.cols();
    out.samples.conservativeResize(columns.rows(), first + columns.cols());
    out.samples.rightCols(columns.cols()) = columns;
    // Several channels in one array have no individual names.
    if (columns.cols() == 1 && !is_pattern(name)) out.channels.names.push_back(name);
  }
  for (Eigen::Index k = 0; k < out.samples.rows(); ++k)
    if (!out.samples.row(k).allFinite())
      arrays.fail("",
                  "{}: sample {} is not finite. Correct it, or import the other "
                  "rows with runs: [{{first_row: ..., rows: ...}}]",
                  key, k);
  name_channels(map, key, group, out, notes);
  return out;
}

}  // namespace stageid
