#include "tools/exchange/arrays/frf_arrays.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/output_file.hpp"
#include "frf/file/frf_file.hpp"

namespace stageid {
namespace {

struct Dataset {
  const char* name;
  std::size_t axes;  ///< 0: texts
};

constexpr Dataset kDatasets[] = {{"frequency_hz", 1},
                                 {"response", 3},
                                 {"inputs", 0},
                                 {"outputs", 0},
                                 {"noise_variance", 3},
                                 {"total_variance", 3},
                                 {"covariance", 3},
                                 {"residual_covariance", 3},
                                 {"input_factor", 3},
                                 {"input_condition", 1},
                                 {"interpolation_misfit", 1},
                                 {"excluded_channels", 0},
                                 {"excluded_power", 1},
                                 {"provenance", 0},
                                 {"detection_frequency_hz", 1},
                                 {"detection_line", 1},
                                 {"detection_groups", 0},
                                 {"detection_runs", 1},
                                 {"detection_power", 3},
                                 {"detection_noise", 2},
                                 {"detection_linear_power", 3},
                                 {"nonlinearity_band_hz", 2},
                                 {"nonlinearity_p_value", 3},
                                 {"nonlinearity_distortion", 3},
                                 {"nonlinearity_settled_p_value", 1},
                                 {"nonlinearity_even_p_value", 3},
                                 {"nonlinearity_even_level", 3},
                                 {"nonlinearity_odd_p_value", 3},
                                 {"nonlinearity_odd_level", 3},
                                 {"dropped_periods", 2},
                                 {"dropped_reasons", 0},
                                 {"left_out_realizations", 1},
                                 {"left_out_reasons", 0}};

constexpr const char* kAttributes[] = {"@format",
                                       "@format_version",
                                       "@sample_rate_hz",
                                       "@hold",
                                       "@compensated",
                                       "@method",
                                       "@covariance_lines",
                                       "@delay_s",
                                       "@realizations",
                                       "@periods",
                                       "@experiments",
                                       "@noise_dof",
                                       "@total_dof",
                                       "@correlated_lines",
                                       "@experiment_noise_ratio",
                                       "inputs@unit",
                                       "outputs@unit",
                                       "detection_noise@dof"};

/// Name of the MATLAB variable: hold for "@hold", inputs_unit for "inputs@unit".
std::string identifier(std::string name) {
  if (name.starts_with('@')) return name.substr(1);
  std::replace(name.begin(), name.end(), '@', '_');
  return name;
}

/// Whether shapes are those of MATLAB; attributes are then variables.
bool from_matlab(const ArrayList& list) { return list.find("@format") == nullptr; }

NamedArray with_axes(const ArrayList& list, NamedArray array, const Dataset& dataset, bool matlab) {
  array.name = dataset.name;
  if (array.is_text() != (dataset.axes == 0))
    throw FormatError(
        list.file, dataset.name,
        array.is_text() ? "contains text; expected numbers" : "contains numbers; expected text");
  if (dataset.axes <= 1) {
    array.shape = {array.size()};
  } else if (matlab && dataset.axes == 3) {
    // MATLAB drops trailing axes of length one; the last axis is that of the lines.
    while (array.shape.size() < dataset.axes) array.shape.push_back(1);
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
  for (const Dataset& dataset : kDatasets)
    if (const NamedArray* array = list.find(dataset.name))
      ours.arrays.push_back(with_axes(list, *array, dataset, matlab));
  for (const char* attribute : kAttributes)
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

bool holds_frf(const ArrayList& list) {
  const NamedArray* format = list.find("@format");
  if (format == nullptr) format = list.find("format");
  const auto* texts =
      format == nullptr ? nullptr : std::get_if<std::vector<std::string>>(&format->values);
  return texts != nullptr && texts->size() == 1 && texts->front() == "stageid-frf";
}

}  // namespace stageid
