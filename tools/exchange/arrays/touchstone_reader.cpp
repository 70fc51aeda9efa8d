#include "tools/exchange/arrays/touchstone_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <numbers>
#include <regex>
#include <sstream>

#include "tools/terminal/text_lines.hpp"

namespace stageid {
namespace {

enum class Form : unsigned char { real_imaginary, magnitude_angle, decibel_angle };

/// Parameters by the quantities of outputs and inputs whose ratio is their unit: of the first and of the other ports.
struct Parameters {
  char letter;
  std::string_view outputs, inputs;
  const char* note;  ///< how the reference resistance is removed

  bool two_ports() const { return outputs[0] != outputs[1]; }
};

constexpr Parameters kParameters[] = {
    {'S', "11", "11", ""},
    {'Z', "VV", "AA", "multiplied by the reference resistance {} ohm: V/A (ohm)"},
    {'Y', "AA", "VV", "divided by the reference resistance {} ohm: A/V (S)"},
    {'H', "VA", "AV",
     "rescaled by the reference resistance {} ohm: h11 in V/A (ohm), h22 in A/V (S)"},
    {'G', "AV", "VA",
     "rescaled by the reference resistance {} ohm: g11 in A/V (S), g22 in V/A (ohm)"}};

/// Null if unknown.
const Parameters* parameters_of(std::string_view word) {
  for (const Parameters& known : kParameters)
    if (word == std::string_view(&known.letter, 1)) return &known;
  return nullptr;
}

struct Options {
  double unit_hz = 1e9;
  Form form = Form::magnitude_angle;
  const Parameters* parameters = &kParameters[0];
  double reference_ohm = 50.0;
};

int ports_of(const std::filesystem::path& file) {
  static const std::regex pattern(R"(\.[sS](\d{1,2})[pP])");
  const std::string ending = file.extension().string();
  std::smatch found;
  return std::regex_match(ending, found, pattern) ? std::stoi(found[1]) : 0;
}

double read_reference(const TextLines& lines, std::istringstream& words) {
  std::string word;
  words >> word;
  const std::optional<double> value = parse_number(word);
  if (!value || !(*value > 0.0))
    lines.fail("'{}' is not a reference resistance. Write for example R 50", word);
  return *value;
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
      options.reference_ohm = read_reference(lines, words);
    else if (const Parameters* parameters = parameters_of(word))
      options.parameters = parameters;
    else
      lines.fail(
          "unknown Touchstone option '{}'. Use HZ, KHZ, MHZ or GHZ, S, Y, Z, G "
          "or H, RI, MA or DB, and R with the reference resistance",
          word);
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
    if (!value) lines.fail("got '{}'; expected a finite number", word);
    numbers.push_back(*value);
  }
}

/// A frequency and 2 N^2 numbers per line. With two ports, noise parameters may follow, starting at a lower frequency.
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
        "{} numbers are not complete lines of {} with rising frequency; check the ending .s{}p",
        numbers.size(), step, ports);
  return count;
}

}  // namespace

bool is_touchstone(const std::filesystem::path& file) { return ports_of(file) > 0; }

TouchstoneFrf read_touchstone(const std::filesystem::path& file) {
  TextLines lines(file);
  const int ports = ports_of(file);
  bool seen = false;
  if (ports < 1) lines.fail("the ending does not contain the number of ports; use .s1p, .s2p, ...");
  Options options;
  std::vector<double> numbers;
  while (!lines.at_end()) {
    std::string_view line = lines.next();
    line = trimmed(line.substr(0, line.find('!')));
    if (line.starts_with('[')) lines.fail("unsupported format Touchstone 2; use Touchstone 1");
    if (line.starts_with('#')) {
      // Later option lines are ignored: specification, section "Option Line".
      if (!seen) options = read_options(lines, line);
      seen = true;
    } else {
      append_numbers(lines, line, numbers);
    }
  }
  const Parameters& parameters = *options.parameters;
  if (parameters.two_ports() && ports != 2)
    lines.fail("{} parameters need two ports, the file name declares {}; name a two-port file .s2p",
               parameters.letter, ports);
  const auto n = static_cast<Eigen::Index>(ports);
  const std::size_t step = 1 + 2 * static_cast<std::size_t>(n * n);
  const std::size_t count = lines_of(lines, numbers, step, ports);
  FrfEstimate frf;
  for (std::size_t port = 0; port < static_cast<std::size_t>(ports); ++port) {
    frf.inputs.names.push_back(fmt::format("port{}", port + 1));
    frf.inputs.units.emplace_back(1, parameters.inputs[std::min<std::size_t>(port, 1)]);
    frf.outputs.units.emplace_back(1, parameters.outputs[std::min<std::size_t>(port, 1)]);
  }
  frf.outputs.names = frf.inputs.names;
  frf.frequency_hz.resize(count);
  frf.response.resize(n * n, static_cast<Eigen::Index>(count));
  for (std::size_t k = 0; k < count; ++k) {
    frf.frequency_hz[k] = numbers[k * step] * options.unit_hz;
    for (Eigen::Index q = 0; q < n * n; ++q) {
      const std::size_t at = k * step + 1 + 2 * static_cast<std::size_t>(q);
      // Row by row, except for two ports: 11, 21, 12, 22.
      const Eigen::Index channel = ports == 2 ? q : q / n + n * (q % n);
      const std::string& output = frf.outputs.unit(channel % n);
      // Version 1 divides an impedance by the reference resistance and multiplies an admittance by it.
      const int power_of_ohm = output == frf.inputs.unit(channel / n) ? 0 : output == "V" ? 1 : -1;
      frf.response(channel, k) = value_of(numbers[at], numbers[at + 1], options.form) *
                                 std::pow(options.reference_ohm, power_of_ohm);
    }
  }
  if (parameters.letter == 'S') return {std::move(frf), ""};
  return {std::move(frf),
          fmt::format("{} parameters {}", parameters.letter,
                      fmt::format(fmt::runtime(parameters.note), options.reference_ohm))};
}

}  // namespace stageid
