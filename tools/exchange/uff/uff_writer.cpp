#include <fmt/format.h>

#include <bit>
#include <optional>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/version.hpp"
#include "tools/exchange/arrays/raw_number.hpp"
#include "tools/exchange/uff/uff_file.hpp"
#include "tools/terminal/text_lines.hpp"

namespace stageid {
namespace {

static_assert(std::endian::native == std::endian::little, "dataset 58b is written as byte order 1");

constexpr const char* kEdgeLine = "    -1\n";

std::string text_line(const std::string& text) {
  if (text.size() > 80)
    fail_request("'{}' is longer than the 80 characters of a line of a universal file; shorten it",
                 text);
  return fmt::format("{:<80}\n", text.empty() ? "NONE" : text);
}

std::string dataset_line(int number) { return fmt::format("{:>6}{:74}\n", number, ""); }

std::string short_field(double value) { return fmt::format("{:13.5E}", value); }

std::string header_text(const UffContent& content) {
  const std::string program = text_line(fmt::format("stageid {}", version()));
  return kEdgeLine + dataset_line(151) + text_line(content.model_name) +
         text_line(content.description) + program +
         fmt::format("{:20}{:>10}{:>10}{:>10}\n", "", 0, 0, 0) + fmt::format("{:20}\n", "") +
         program + fmt::format("{:20}\n", "") + kEdgeLine;
}

/// SI: factors of length, force and temperature, and the offset of temperatures, as D25.17.
constexpr const char* kUnits =
    "         1SI                           2\n"
    "  1.00000000000000000D+00  1.00000000000000000D+00  1.00000000000000000D+00\n"
    "  2.73149999999999977D+02\n";

std::string axis_line(const UffAxis& axis) {
  if (axis.unit.size() > 20)
    fail_request("unit '{}' is longer than the 20 characters of a universal file; shorten it",
                 axis.unit);
  return fmt::format("{:>10}{:>5}{:>5}{:>5} {:<20.20} {:<20}\n", axis.type, axis.exponents[0],
                     axis.exponents[1], axis.exponents[2], axis.label,
                     axis.unit.empty() ? "NONE" : axis.unit);
}

/// Minimum and step of an even abscissa, as they read back from the file.
struct EvenAbscissa {
  bool even = false;
  double minimum = 0.0;
  double step = 0.0;
};

EvenAbscissa even_abscissa(const std::vector<double>& x) {
  if (x.size() < 2) return {};
  const std::optional<double> minimum = parse_number(short_field(x[0]));
  const std::optional<double> step = parse_number(short_field(x[1] - x[0]));
  if (!minimum || !step) return {};
  const EvenAbscissa found{true, *minimum, *step};
  for (std::size_t k = 0; k < x.size(); ++k)
    if (found.minimum + static_cast<double>(k) * found.step != x[k]) return {};
  return found;
}

std::string point_text(const UffPoint& point) {
  return fmt::format(" {:<10.10}{:>10}{:>4}", point.entity.empty() ? "NONE" : point.entity,
                     point.node, point.direction);
}

/// Records 1 to 11.
std::string function_head(const UffFunction& f, const EvenAbscissa& even) {
  std::string text;
  for (const std::string& id : f.id) text += text_line(id);
  text += fmt::format("{:>5}{:>10}{:>5}{:>10}{}{}\n", f.type, 0, 0, 0, point_text(f.response),
                      point_text(f.reference));
  text += fmt::format("{:>10}{:>10}{:>10}{}{}{}\n", f.complex ? 6 : 4, f.abscissa.size(),
                      even.even ? 1 : 0, short_field(even.minimum), short_field(even.step),
                      short_field(0.0));
  return text + axis_line(f.abscissa_axis) + axis_line(f.ordinate_axis) +
         axis_line(f.denominator_axis) + axis_line({});
}

/// Record 12 in the formats 4E20.12, 2(E13.5,E20.12) and E13.5,2E20.12.
std::string text_values(const UffFunction& f, bool even) {
  std::string text;
  std::size_t fields = 0;
  const std::size_t fields_a_line = !even && f.complex ? 3 : 4;
  const auto put = [&](const std::string& field) {
    text += field;
    if (++fields % fields_a_line == 0) text += '\n';
  };
  for (std::size_t k = 0; k < f.abscissa.size(); ++k) {
    if (!even) put(short_field(f.abscissa[k]));
    put(fmt::format("{:20.12E}", f.ordinate[k].real()));
    if (f.complex) put(fmt::format("{:20.12E}", f.ordinate[k].imag()));
  }
  if (fields % fields_a_line != 0) text += '\n';
  return text;
}

/// The specification has abscissas of single precision. The most common readers, pyuff and MATLAB's readuff, expect
/// the precision of the ordinate and fail on such files.
std::string binary_values(const UffFunction& f, bool even) {
  std::string bytes;
  for (std::size_t k = 0; k < f.abscissa.size(); ++k) {
    if (!even) append_raw(bytes, f.abscissa[k]);
    append_raw(bytes, f.ordinate[k].real());
    if (f.complex) append_raw(bytes, f.ordinate[k].imag());
  }
  return bytes;
}

std::string function_text(const UffFunction& f, bool binary) {
  const EvenAbscissa even = even_abscissa(f.abscissa);
  if (!binary)
    return kEdgeLine + dataset_line(58) + function_head(f, even) + text_values(f, even.even) +
           kEdgeLine;
  const std::string bytes = binary_values(f, even.even);
  return kEdgeLine +
         fmt::format("{:>6}b{:>6}{:>6}{:>12}{:>12}{:>6}{:>6}{:>12}{:>12}\n", 58, 1, 2, 11,
                     bytes.size(), 0, 0, 0, 0) +
         function_head(f, even) + bytes + kEdgeLine;
}

/// Fields of E13.5, six per line.
std::string short_lines(const std::vector<double>& values) {
  std::string text;
  for (std::size_t k = 0; k < values.size(); ++k) {
    text += short_field(values[k]);
    if (k % 6 == 5 || k + 1 == values.size()) text += '\n';
  }
  return text;
}

std::string mode_text(const UffMode& mode) {
  std::string text = kEdgeLine + dataset_line(55);
  for (const std::string& id : mode.id) text += text_line(id);
  // Structural; displacement. One scalar per node, or X, Y and Z.
  text +=
      fmt::format("{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}\n", 1, mode.complex ? 3 : 2,
                  mode.values_per_node == 3 ? 2 : 1, 8, mode.complex ? 5 : 2, mode.values_per_node);
  text += fmt::format("{:>10}{:>10}{:>10}{:>10}\n", 2, mode.complex ? 6 : 4, 0, mode.number);
  const std::complex<double> b = -mode.pole_rad_s * mode.modal_a;
  text += mode.complex ? short_lines({mode.pole_rad_s.real(), mode.pole_rad_s.imag(),
                                      mode.modal_a.real(), mode.modal_a.imag(), b.real(), b.imag()})
                       : short_lines({mode.frequency_hz, mode.modal_mass, mode.damping_ratio, 0.0});
  for (std::size_t k = 0; k < mode.nodes.size(); ++k) {
    text += fmt::format("{:>10}\n", mode.nodes[k]);
    std::vector<double> values;
    for (std::size_t q = 0; q < mode.values_per_node; ++q) {
      const std::complex<double> value = mode.values.at(k * mode.values_per_node + q);
      values.push_back(value.real());
      if (mode.complex) values.push_back(value.imag());
    }
    text += short_lines(values);
  }
  return text + kEdgeLine;
}

}  // namespace

void write_uff(const std::filesystem::path& file, const UffContent& content) {
  const bool binary = file.extension() == ".uff";
  std::string text = header_text(content) + kEdgeLine + dataset_line(164) + kUnits + kEdgeLine;
  for (const UffFunction& function : content.functions) text += function_text(function, binary);
  for (const UffMode& mode : content.modes) text += mode_text(mode);
  write_text_file(file, text);
}

}  // namespace stageid
