#include "tools/exchange/arrays/frf_arrays.hpp"

#include <algorithm>
#include <iterator>
#include <sstream>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/output_file.hpp"
#include "frf/file/frf_file.hpp"

namespace stageid {
namespace {

/// Words separated by blanks.
std::vector<std::string> words_in(const char* text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

/// The datasets by their number of axes; 0: texts.
constexpr const char* kDatasets[] = {
    "inputs outputs excluded_channels provenance detection_groups dropped_reasons "
    "replaced_reasons left_out_reasons",
    "frequency_hz input_condition interpolation_misfit excluded_power detection_frequency_hz "
    "detection_line detection_runs nonlinearity_settled_p_value left_out_realizations",
    "detection_noise nonlinearity_band_hz dropped_periods replaced_samples",
    "response noise_variance total_variance covariance residual_covariance input_factor "
    "detection_power detection_linear_power nonlinearity_p_value nonlinearity_distortion "
    "nonlinearity_even_p_value nonlinearity_even_level nonlinearity_odd_p_value "
    "nonlinearity_odd_level"};

constexpr const char* kAttributes =
    "@format @format_version @sample_rate_hz @hold @compensated @method @covariance_lines "
    "@delay_s @realizations @periods @experiments @noise_dof @total_dof @correlated_lines "
    "@experiment_noise_ratio inputs@unit outputs@unit detection_noise@dof";

/// Name of the MATLAB variable: hold for "@hold", inputs_unit for "inputs@unit".
std::string identifier(std::string name) {
  if (name.starts_with('@')) return name.substr(1);
  std::ranges::replace(name, '@', '_');
  return name;
}

/// Whether shapes are those of MATLAB; attributes are then variables.
bool from_matlab(const ArrayList& list) { return list.find("@format") == nullptr; }

NamedArray with_axes(const ArrayList& list, NamedArray array, const std::string& name,
                     std::size_t axes, bool matlab) {
  array.name = name;
  if (array.is_text() != (axes == 0))
    throw FormatError(
        list.file, name,
        array.is_text() ? "contains text; expected numbers" : "contains numbers; expected text");
  if (axes <= 1) {
    array.shape = {array.size()};
  } else if (matlab && axes == 3) {
    // MATLAB drops trailing axes of length one; the last axis is that of the lines.
    while (array.shape.size() < axes) array.shape.push_back(1);
    if (array.shape.size() == 3) array = permuted(array, {2, 0, 1});
  }
  return array;
}

}  // namespace

ArrayList arrays_of_frf(const FrfEstimate& frf, const std::filesystem::path& beside) {
  const OutputFile scratch(beside);
  write_frf(scratch.path(), frf);
  return read_hdf5_arrays(scratch.path());
}

FrfEstimate frf_of_arrays(const ArrayList& list, const std::filesystem::path& beside) {
  const bool matlab = from_matlab(list);
  ArrayList ours{list.file, {}};
  for (std::size_t axes = 0; axes < std::size(kDatasets); ++axes)
    for (const std::string& name : words_in(kDatasets[axes]))
      if (const NamedArray* array = list.find(name))
        ours.arrays.push_back(with_axes(list, *array, name, axes, matlab));
  for (const std::string& attribute : words_in(kAttributes))
    if (const NamedArray* array = list.find(matlab ? identifier(attribute) : attribute)) {
      NamedArray copy = *array;
      copy.name = attribute;
      copy.shape.clear();
      if (copy.size() != 1) copy.shape = {copy.size()};
      ours.arrays.push_back(std::move(copy));
    }
  const OutputFile scratch(beside);
  const std::string scratch_name = scratch.path().string();
  try {
    write_hdf5_arrays(scratch.path(), ours);
    return read_frf(scratch.path());
  } catch (const FormatError& error) {
    std::string text = error.what();
    if (text.starts_with(scratch_name + ":")) text.erase(0, scratch_name.size() + 1);
    if (text.starts_with('/') || text.starts_with(' ')) text.erase(0, 1);
    throw FormatError(list.file, "", text);
  }
}

Eigen::Index place_in(ChannelList& channels, const std::string& name, const std::string& unit) {
  const auto found = std::ranges::find(channels.names, name);
  if (found != channels.names.end()) return found - channels.names.begin();
  channels.names.push_back(name);
  channels.units.push_back(unit);
  return std::ssize(channels) - 1;
}

bool holds_frf(const ArrayList& list) {
  const NamedArray* format = list.find("@format");
  if (format == nullptr) format = list.find("format");
  const auto* texts =
      format == nullptr ? nullptr : std::get_if<std::vector<std::string>>(&format->values);
  return texts != nullptr && texts->size() == 1 && texts->front() == "stageid-frf";
}

}  // namespace stageid
