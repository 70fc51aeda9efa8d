#include "tools/touchstone_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <numbers>
#include <sstream>

#include "tools/text_lines.hpp"

namespace stageid {
namespace {

enum class Form : unsigned char { real_imaginary, magnitude_angle, decibel_angle };

struct Options {
  double unit_hz = 1e9;
  Form form = Form::magnitude_angle;
};

int ports_of(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending.size() < 4 || ending.size() > 5 || std::tolower(ending[1]) != 's' ||
      std::tolower(ending.back()) != 'p')
    return 0;
  const std::string digits = ending.substr(2, ending.size() - 3);
  if (!std::all_of(digits.begin(), digits.end(), [](unsigned char c) { return std::isdigit(c); }))
    return 0;
  return std::stoi(digits);
}

Options read_options(const TextLines& lines, std::string_view line) {
  static const std::map<std::string, double> kUnits = {
      {"HZ", 1.0}, {"KHZ", 1e3}, {"MHZ", 1e6}, {"GHZ", 1e9}};
  static const std::map<std::string, Form> kForms = {
      {"RI", Form::real_imaginary}, {"MA", Form::magnitude_angle}, {"DB", Form::decibel_angle}};
  Options options;
  std::istringstream words{std::string(line.substr(1))};
  for (std::string word; words >> word;) {
    std::transform(word.begin(), word.end(), word.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    if (kUnits.contains(word))
      options.unit_hz = kUnits.at(word);
    else if (kForms.contains(word))
      options.form = kForms.at(word);
    else if (word == "R")
      words >> word;
    else if (std::string("SYZGH").find(word) == std::string::npos)
      lines.fail(fmt::format("option '{}' is none of Touchstone 1", word));
  }
  return options;
}

std::complex<double> value_of(double a, double b, Form form) {
  if (form == Form::real_imaginary) return {a, b};
  return std::polar(form == Form::decibel_angle ? std::pow(10.0, a / 20.0) : a,
                    b * std::numbers::pi / 180.0);
}

void append_numbers(const TextLines& lines, std::string_view line, std::vector<double>& numbers) {
  std::istringstream words{std::string(line)};
  for (std::string word; words >> word;) {
    const std::optional<double> value = parse_number(word);
    if (!value) lines.fail(fmt::format("'{}' stands where a finite number belongs", word));
    numbers.push_back(*value);
  }
}

/// Frequency and 2 N^2 numbers a line; of two ports noise parameters may follow, from a lower frequency on.
std::size_t lines_of(const TextLines& lines, const std::vector<double>& numbers, std::size_t step,
                     int ports) {
  std::size_t count = 0;
  while ((count + 1) * step <= numbers.size() &&
         (count == 0 || numbers[count * step] > numbers[(count - 1) * step]))
    ++count;
  const bool noise = ports == 2 && count > 0 && count * step < numbers.size() &&
                     numbers[count * step] <= numbers[(count - 1) * step];
  if (count == 0 || (count * step != numbers.size() && !noise))
    lines.fail(
        fmt::format("{} numbers are no whole lines of {} with rising frequency; is the ending "
                    ".s{}p right?",
                    numbers.size(), step, ports));
  return count;
}

}  // namespace

bool is_touchstone(const std::filesystem::path& file) { return ports_of(file) > 0; }

FrfEstimate read_touchstone(const std::filesystem::path& file) {
  TextLines lines(file);
  const int ports = ports_of(file);
  if (ports < 1) lines.fail("the ending tells no number of ports; write .s1p, .s2p, ...");
  Options options;
  std::vector<double> numbers;
  while (!lines.at_end()) {
    std::string_view line = lines.next();
    line = trimmed(line.substr(0, line.find('!')));
    if (line.starts_with('[')) lines.fail("is Touchstone 2; write Touchstone 1 instead");
    if (line.starts_with('#'))
      options = read_options(lines, line);
    else
      append_numbers(lines, line, numbers);
  }
  const auto n = static_cast<Eigen::Index>(ports);
  const std::size_t step = 1 + 2 * static_cast<std::size_t>(n * n);
  const std::size_t count = lines_of(lines, numbers, step, ports);
  FrfEstimate frf;
  for (int port = 1; port <= ports; ++port) {
    frf.inputs.names.push_back(fmt::format("port{}", port));
    frf.inputs.units.emplace_back("1");
  }
  frf.outputs = frf.inputs;
  frf.frequency_hz.resize(static_cast<Eigen::Index>(count));
  frf.response.resize(n * n, static_cast<Eigen::Index>(count));
  for (std::size_t k = 0; k < count; ++k) {
    const auto line = static_cast<Eigen::Index>(k);
    frf.frequency_hz[line] = numbers[k * step] * options.unit_hz;
    for (Eigen::Index q = 0; q < n * n; ++q) {
      const std::size_t at = k * step + 1 + 2 * static_cast<std::size_t>(q);
      // Row by row, but for two ports: 11, 21, 12, 22.
      const Eigen::Index channel = ports == 2 ? q : q / n + n * (q % n);
      frf.response(channel, line) = value_of(numbers[at], numbers[at + 1], options.form);
    }
  }
  return frf;
}

}  // namespace stageid
