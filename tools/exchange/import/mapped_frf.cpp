#include "tools/exchange/import/mapped_frf.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "frf/file/line_datasets.hpp"
#include "tools/exchange/arrays/frf_arrays.hpp"
#include "tools/exchange/import/import_signals.hpp"

namespace stageid {
namespace {

using Complex = std::vector<std::complex<double>>;

/// Axes of the array for line, output and input, in this order.
std::vector<std::size_t> axis_places(const ImportMap& map) {
  std::vector<std::size_t> places;
  for (const char* axis : {"line", "output", "input"}) {
    const auto found = std::ranges::find(map.axes, axis);
    if (found == map.axes.end())
      refuse_map(map, "axes: got {}; expected line, output and input in any order",
                 fmt::join(map.axes, ", "));
    places.push_back(static_cast<std::size_t>(found - map.axes.begin()));
  }
  return places;
}

/// The array as lines x outputs x inputs.
NamedArray arranged(const ArrayList& arrays, const NamedArray& array, const ImportMap& map,
                    std::size_t lines) {
  NamedArray result = array;
  if (map.axes.empty()) {
    if (!array.is_vector() || array.size() != lines)
      refuse_map(map,
                 "key 'axes' is missing; '{}' has the shape {} with {} frequencies, "
                 "write for example axes: [output, input, line]",
                 array.name, fmt::join(array.shape, " x "), lines);
    result.shape = {array.size(), 1, 1};
    return result;
  }
  // MATLAB drops trailing axes of length one; a vector is a single channel.
  while (result.shape.size() < 3) result.shape.push_back(1);
  if (result.shape.size() > 3)
    arrays.fail(array.name, "has the shape {}; expected lines, outputs and inputs",
                fmt::join(array.shape, " x "));
  result = permuted(result, axis_places(map));
  if (result.shape[0] != lines)
    arrays.fail(array.name, "has the shape {} with axes {}; expected {} frequencies",
                fmt::join(array.shape, " x "), fmt::join(map.axes, ", "), lines);
  return result;
}

std::vector<std::string> names_or(const ImportMap& map, const char* key,
                                  const std::vector<std::string>& given, std::size_t count,
                                  const char* prefix) {
  std::vector<std::string> names = given;
  for (std::size_t k = 0; k < count && given.empty(); ++k)
    names.push_back(fmt::format("{}{}", prefix, k + 1));
  if (names.size() != count)
    refuse_map(map, "{}: got {} names; the response has {}", key, names.size(), count);
  return names;
}

/// From lines x outputs x inputs.
template <typename Scalar>
VecColumns<Scalar> vec_columns(const std::vector<Scalar>& values,
                               const std::vector<std::size_t>& shape) {
  return from_c_order(values, static_cast<Eigen::Index>(shape[1]),
                      static_cast<Eigen::Index>(shape[2]));
}

Complex complex_of(const ArrayList& arrays, const std::string& real, const std::string& imaginary) {
  Complex values = complex_values(arrays, arrays.at(real));
  if (imaginary.empty()) return values;
  const std::vector<double>& parts = real_values(arrays, arrays.at(imaginary));
  if (parts.size() != values.size())
    arrays.fail(imaginary, "has {} values; '{}' has {}", parts.size(), real, values.size());
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = {values[k].real(), parts[k]};
  return values;
}

Complex polar_of(const ArrayList& arrays, const ImportMap::Channel& channel) {
  Complex values = complex_of(arrays, channel.magnitude, channel.phase_deg);
  for (std::complex<double>& value : values) {
    if (value.real() < 0.0)
      arrays.fail(channel.magnitude, "a magnitude is {}; convert values in dB by 10^(dB / 20)",
                  value.real());
    value = std::polar(1.0, value.imag() * std::numbers::pi / 180.0) * value.real();
  }
  return values;
}

double scalar_of(const ArrayList& arrays, const ImportMap::Scalar& scalar) {
  if (scalar.number) return *scalar.number;
  const std::vector<double>& values = real_values(arrays, arrays.at(scalar.variable));
  if (values.size() != 1)
    arrays.fail(scalar.variable, "has {} values; expected one number", values.size());
  return values.front();
}

/// As many frequencies as the response has lines.
std::vector<double> even_frequencies(const ArrayList& arrays, const ImportMap& map) {
  const double first = scalar_of(arrays, map.first_hz), step = scalar_of(arrays, map.step_hz);
  if (!(step > 0.0)) refuse_map(map, "step_hz: {} is not positive; write a positive number", step);
  const ImportMap::Channel* channel = map.channels.empty() ? nullptr : &map.channels.front();
  const NamedArray& array = arrays.at(channel == nullptr            ? map.response
                                      : !channel->response.empty()  ? channel->response
                                      : !channel->magnitude.empty() ? channel->magnitude
                                                                    : channel->real);
  std::size_t lines = array.size();
  if (channel == nullptr && !map.axes.empty()) {
    const std::size_t place = axis_places(map).front();
    lines = place < array.shape.size() ? array.shape[place] : 1;
  }
  std::vector<double> frequency;
  for (std::size_t k = 0; k < lines; ++k)
    frequency.push_back(first + static_cast<double>(k) * step);
  return frequency;
}

void read_whole_response(const ArrayList& arrays, const ImportMap& map, FrfEstimate& frf) {
  const auto lines = static_cast<std::size_t>(frf.lines());
  NamedArray array = arrays.at(map.response);
  array.values = complex_of(arrays, map.response, map.response_imaginary);
  array = arranged(arrays, array, map, lines);
  frf.response = vec_columns(std::get<1>(array.values), array.shape);
  frf.outputs.names = names_or(map, "outputs", map.outputs, array.shape[1], "y");
  frf.inputs.names = names_or(map, "inputs", map.inputs, array.shape[2], "u");
  const auto variance = [&](const std::string& name) -> Eigen::MatrixXd {
    if (name.empty()) return {};
    const NamedArray found = arranged(arrays, arrays.at(name), map, lines);
    if (found.shape != array.shape)
      arrays.fail(name, "does not have the shape of '{}'", map.response);
    return vec_columns(real_values(arrays, found), found.shape);
  };
  frf.noise_variance = variance(map.noise_variance);
  frf.total_variance = variance(map.total_variance);
}

void read_channels(const ArrayList& arrays, const ImportMap& map, FrfEstimate& frf) {
  frf.outputs.names = map.outputs;
  frf.inputs.names = map.inputs;
  for (const ImportMap::Channel& channel : map.channels) {
    if (map.outputs.empty()) place_in(frf.outputs, channel.output, "");
    if (map.inputs.empty()) place_in(frf.inputs, channel.input, "");
  }
  frf.response =
      Eigen::MatrixXcd::Constant(frf.n_outputs() * frf.n_inputs(), frf.lines(), std::nan(""));
  if (!map.channels.front().noise_variance.empty()) frf.noise_variance = frf.response.real();
  if (!map.channels.front().total_variance.empty()) frf.total_variance = frf.response.real();
  const auto place = [&](const std::vector<std::string>& names, const std::string& name) {
    const auto found = std::ranges::find(names, name);
    if (found == names.end())
      refuse_map(map, "channels: unknown name '{}'; use one of {}", name, fmt::join(names, ", "));
    return found - names.begin();
  };
  for (const ImportMap::Channel& channel : map.channels) {
    const std::string& real = channel.real.empty() ? channel.response : channel.real;
    const Complex values = channel.magnitude.empty() ? complex_of(arrays, real, channel.imaginary)
                                                     : polar_of(arrays, channel);
    const Eigen::Index row = place(frf.outputs.names, channel.output) +
                             frf.n_outputs() * place(frf.inputs.names, channel.input);
    const auto put = [&](const auto& column, auto& matrix) {
      if (std::ssize(column) != frf.lines())
        refuse_map(map, "channels: {} <- {} has {} values; expected {}, one per frequency",
                   channel.output, channel.input, column.size(), frf.lines());
      std::copy(column.begin(), column.end(), matrix.row(row).begin());
    };
    put(values, frf.response);
    if (frf.noise_variance.size() > 0)
      put(real_values(arrays, arrays.at(channel.noise_variance)), frf.noise_variance);
    if (frf.total_variance.size() > 0)
      put(real_values(arrays, arrays.at(channel.total_variance)), frf.total_variance);
  }
  if (map.channels.size() != frf.outputs.size() * frf.inputs.size())
    refuse_map(map, "channels: got {} for {} outputs and {} inputs; write every pair once",
               map.channels.size(), frf.outputs.size(), frf.inputs.size());
}

}  // namespace

FrfEstimate mapped_frf(const ArrayList& arrays, const ImportMap& map) {
  FrfEstimate frf;
  if (map.sample_rate_hz > 0.0) (void)sample_rate_of(arrays, map);  // that of the file must agree
  const std::vector<double> frequency = map.frequency.empty()
                                            ? even_frequencies(arrays, map)
                                            : real_values(arrays, arrays.at(map.frequency));
  frf.frequency_hz = Eigen::Map<const Eigen::VectorXd>(frequency.data(), std::ssize(frequency));
  if (map.frequency_unit == ImportMap::FrequencyUnit::rad_s)
    frf.frequency_hz /= 2.0 * std::numbers::pi;
  if (map.channels.empty())
    read_whole_response(arrays, map, frf);
  else
    read_channels(arrays, map, frf);
  frf.outputs.units = units_of(map, "output_unit", map.output_unit, frf.outputs.size());
  frf.inputs.units = units_of(map, "input_unit", map.input_unit, frf.inputs.size());
  frf.sample_rate_hz = map.sample_rate_hz;
  frf.hold = map.hold;
  return frf;
}

}  // namespace stageid
