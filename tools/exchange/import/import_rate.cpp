#include "tools/exchange/import/import_signals.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace stageid {
namespace {

/// Largest relative error of a rate or a step that was rounded to four digits.
constexpr double kRounding = 5e-4;
/// A step of this many times the usual one means that samples are missing. Rounded times have steps of up to twice.
constexpr double kJump = 2.5;

struct FileRate {
  double hz = 0.0;
  std::string told_by;
};

/// Last part of a path or the attribute's name, lower case without separators.
std::string plain_name(const std::string& name) {
  const std::size_t at = name.find_last_of("/@.");
  std::string out;
  for (const char c : at == std::string::npos ? name : name.substr(at + 1))
    if (c != '_' && c != ' ' && c != '[' && c != ']' && c != '(' && c != ')')
      out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

std::optional<double> rate_of_scalar(const std::string& name, double value) {
  static const std::regex kRate("sampl(e|ing)(rate|frequency)(hz)?|fs(hz)?|fsample");
  static const std::regex kStep(
      "dts?|ts|tsample|sampletimes?|samplingtime|sampleperiods?|wfincrement");
  if (!(value > 0.0)) return std::nullopt;
  if (std::regex_match(name, kRate)) return value;
  if (std::regex_match(name, kStep)) return 1.0 / value;
  return std::nullopt;
}

/// A time axis in seconds: its rate, and where it jumps ahead although its pieces do not have one length, as runs do.
struct TimeAxis {
  double hz = 0.0;
  std::optional<std::size_t> jump;  ///< index of the last sample before it
};

/// @returns nothing if the axis does not rise. It may restart with every run.
std::optional<TimeAxis> time_axis_of(const std::vector<double>& time_s) {
  if (time_s.size() < 3) return std::nullopt;
  std::vector<double> steps;
  for (std::size_t k = 1; k < time_s.size(); ++k) steps.push_back(time_s[k] - time_s[k - 1]);
  std::vector<double> sorted = steps;
  const auto middle = sorted.begin() + sorted.size() / 2;
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double step = *middle;
  if (!(step > 0.0)) return std::nullopt;
  // Single steps have few digits; the mean within the pieces is more precise.
  TimeAxis axis;
  std::set<std::size_t> lengths;
  std::size_t begin = 0;
  double within_s = 0.0;
  double count = 0.0;
  for (std::size_t k = 0; k <= steps.size(); ++k) {
    const bool ends = k == steps.size() || steps[k] < -0.5 * step || steps[k] > kJump * step;
    if (!ends) {
      within_s += steps[k];
      ++count;
      continue;
    }
    lengths.insert(k + 1 - begin);
    begin = k + 1;
    if (k < steps.size() && steps[k] > 0.0 && !axis.jump) axis.jump = k;
  }
  if (lengths.size() == 1) axis.jump.reset();
  axis.hz = count / within_s;
  return axis;
}

std::vector<FileRate> rates_of(const ArrayList& arrays, const ImportMap& map) {
  static const std::set<std::string> kAxes = {"t", "ts", "time", "times", "timeaxis"};
  std::set<std::string> abscissas;
  for (const auto& [key, group] : map.groups())
    for (const std::string& name : group->arrays) abscissas.insert(name + "@abscissa");
  std::vector<FileRate> rates;
  for (const NamedArray& array : arrays.arrays) {
    const auto* values = std::get_if<std::vector<double>>(&array.values);
    if (values == nullptr || values->empty()) continue;
    const bool axis = abscissas.contains(array.name) ||
                      (values->size() > 1 && kAxes.contains(plain_name(array.name)));
    const auto time = axis ? time_axis_of(*values) : std::nullopt;
    if (time && time->jump)
      refuse_map(map,
                 "'{}' of {} jumps by {:.3g} s behind sample {}: samples are missing, or runs of "
                 "different length follow each other. Split the file there, or write "
                 "sample_rate_hz and file_sample_rate: ignored",
                 array.name, arrays.file.string(),
                 (*values)[*time->jump + 1] - (*values)[*time->jump], *time->jump + 1);
    const auto rate = time ? std::optional(time->hz)
                      : values->size() == 1
                          ? rate_of_scalar(plain_name(array.name), values->front())
                          : std::nullopt;
    if (rate) rates.push_back({*rate, array.name});
  }
  return rates;
}

/// The nearest number of six digits, if the difference is rounding of the time axis.
double snapped(double hz) {
  const double unit = std::pow(10.0, std::floor(std::log10(hz)) - 5.0);
  const double round = std::round(hz / unit) * unit;
  return std::abs(round - hz) < 1e-7 * hz ? round : hz;
}

bool agree(double a, double b) { return std::abs(a - b) <= kRounding * std::max(a, b); }

}  // namespace

double sample_rate_of(const ArrayList& arrays, const ImportMap& map) {
  if (map.file_sample_rate == ImportMap::FileSampleRate::ignored && map.sample_rate_hz > 0.0)
    return map.sample_rate_hz;
  const std::vector<FileRate> rates = rates_of(arrays, map);
  if (map.sample_rate_hz > 0.0) {
    const bool confirmed = rates.empty() || std::ranges::any_of(rates, [&](const FileRate& rate) {
                             return agree(rate.hz, map.sample_rate_hz);
                           });
    if (confirmed) return map.sample_rate_hz;
    refuse_map(map,
               "sample_rate_hz: {} contradicts {} Hz, from '{}' of {}. Correct "
               "sample_rate_hz, or write file_sample_rate: ignored if the file is wrong",
               map.sample_rate_hz, fmt::format("{:.6g}", rates.front().hz), rates.front().told_by,
               arrays.file.string());
  }
  if (rates.empty())
    refuse_map(map, "a log needs sample_rate_hz, which {} does not contain; add the key",
               arrays.file.string());
  for (const FileRate& rate : rates)
    if (!agree(rate.hz, rates.front().hz))
      refuse_map(map,
                 "a log needs sample_rate_hz: '{}' of {} is {:.6g} Hz, but '{}' "
                 "is {:.6g} Hz; add the key",
                 rates.front().told_by, arrays.file.string(), rates.front().hz, rate.told_by,
                 rate.hz);
  return snapped(rates.front().hz);
}

}  // namespace stageid
