#include <bit>
#include <cmath>

#include "tools/exchange/arrays/raw_number.hpp"
#include "tools/exchange/uff/uff_file.hpp"
#include "tools/terminal/text_lines.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

constexpr std::string_view kEdge = "-1";

/// Fields of fixed width of one record.
class Record {
 public:
  Record(const TextLines& lines, std::string_view line) : lines_(lines), line_(line) {}

  std::string text(std::size_t width) { return utf8_of_text(trimmed(take(width))); }
  long long integer(std::size_t width) { return static_cast<long long>(number(width, "whole")); }
  double number(std::size_t width, std::string_view kind = "finite") {
    const std::string_view field = trimmed(take(width));
    if (field.empty()) return 0.0;
    const std::optional<double> value = parse_number(field);
    if (!value || (kind == "whole" && (*value != std::trunc(*value) || std::abs(*value) > 1e15)))
      lines_.fail("got '{}'; expected a {} number", field, kind);
    return *value;
  }
  bool at_end() const { return trimmed(line_).empty(); }

 private:
  std::string_view take(std::size_t width) {
    const std::string_view field = line_.substr(0, width);
    line_.remove_prefix(field.size());
    return field;
  }
  const TextLines& lines_;
  std::string_view line_;
};

struct DataForm {
  bool double_precision = true;
  bool complex = false;
  bool even = true;
  std::size_t count = 0;
  double minimum = 0.0;
  double step = 0.0;
};

UffPoint read_point(Record& record) {
  UffPoint point;
  point.entity = record.text(11);
  point.node = record.integer(10);
  point.direction = static_cast<int>(record.integer(4));
  return point;
}

UffAxis read_axis(TextLines& lines) {
  Record record(lines, lines.next());
  UffAxis axis;
  axis.type = static_cast<int>(record.integer(10));
  for (int& exponent : axis.exponents) exponent = static_cast<int>(record.integer(5));
  for (std::string* text : {&axis.label, &axis.unit}) {
    *text = record.text(21);
    if (text->empty()) *text = "NONE";
  }
  return axis;
}

DataForm read_form(TextLines& lines) {
  Record record(lines, lines.next());
  const long long type = record.integer(10);
  const long long count = record.integer(10);
  if (type != 2 && type != 4 && type != 5 && type != 6)
    lines.fail("unsupported ordinate data type {}; expected 2, 4, 5 or 6", type);
  if (count < 1) lines.fail("got {} values; expected at least 1", count);
  DataForm form;
  form.double_precision = type == 4 || type == 6;
  form.complex = type >= 5;
  form.count = static_cast<std::size_t>(count);
  form.even = record.integer(10) == 1;
  form.minimum = record.number(13);
  form.step = record.number(13);
  if (form.count > lines.rest().size())
    lines.fail("{} values exceed the file size; the file is truncated", count);
  return form;
}

/// Record 12 as text: the widths of the fields repeat along the values of a line.
std::vector<double> text_values(TextLines& lines, const DataForm& form) {
  const std::size_t width = form.double_precision ? 20 : 13;
  const std::size_t ordinates = form.complex ? 2 : 1;
  std::vector<std::size_t> widths(ordinates, width);
  if (!form.even) widths.insert(widths.begin(), 13);
  std::vector<double> values;
  const std::size_t wanted = form.count * widths.size();
  values.reserve(wanted);
  while (values.size() < wanted) {
    const std::string_view line = lines.next();
    if (trimmed(line) == kEdge)
      lines.fail("the data end after {} of {} numbers; the file is truncated", values.size(),
                 wanted);
    Record record(lines, line);
    while (values.size() < wanted && !record.at_end())
      values.push_back(record.number(widths[values.size() % widths.size()]));
  }
  return values;
}

/// True if the data end at `bytes`: the delimiter follows, possibly on a line of its own.
bool ends_at(std::string_view rest, std::size_t bytes) {
  if (bytes > rest.size()) return false;
  const std::string_view behind = rest.substr(bytes, 10);
  return trimmed(behind).starts_with(kEdge) && behind.find_first_not_of(" \r\n") >= 4;
}

/// Record 12 in binary. The width of the abscissas follows from the end of the data, because some programs write a
/// wrong number of bytes in the head of the dataset.
std::vector<double> binary_values(TextLines& lines, const DataForm& form, std::endian order) {
  const std::string_view rest = lines.rest();
  const std::size_t width = form.double_precision ? 8 : 4;
  const std::size_t ordinates = form.complex ? 2 : 1;
  const bool big_endian = order == std::endian::big;
  std::vector<std::size_t> abscissa_widths = {0};
  if (!form.even) abscissa_widths = {4, 8};
  for (const std::size_t abscissa_width : abscissa_widths) {
    const std::size_t step = abscissa_width + ordinates * width;
    if (!ends_at(rest, form.count * step)) continue;
    std::vector<double> values;
    const char* at = rest.data();
    const auto read = [&](std::size_t bytes) {
      values.push_back(bytes == 4 ? static_cast<double>(raw_number<float>(at, big_endian))
                                  : raw_number<double>(at, big_endian));
      at += bytes;
    };
    for (std::size_t k = 0; k < form.count; ++k) {
      if (abscissa_width > 0) read(abscissa_width);
      for (std::size_t q = 0; q < ordinates; ++q) read(width);
    }
    lines.skip(form.count * step);
    return values;
  }
  lines.fail("{} values do not match the end of the dataset; the file is damaged", form.count);
}

void distribute(const std::vector<double>& values, const DataForm& form, UffFunction& f) {
  std::size_t at = 0;
  for (std::size_t k = 0; k < form.count; ++k) {
    f.abscissa.push_back(form.even ? form.minimum + static_cast<double>(k) * form.step
                                   : values[at++]);
    const double real = values[at++];
    f.ordinate.emplace_back(real, form.complex ? values[at++] : 0.0);
  }
}

UffFunction read_function(TextLines& lines, const std::optional<std::endian>& binary) {
  UffFunction f;
  f.line = lines.line_number();
  for (std::string& id : f.id) id = utf8_of_text(trimmed(lines.next()));
  Record record(lines, lines.next());
  f.type = static_cast<int>(record.integer(5));
  record.text(25);  // function id, version, load case
  f.response = read_point(record);
  f.reference = read_point(record);
  const DataForm form = read_form(lines);
  f.complex = form.complex;
  f.abscissa_axis = read_axis(lines);
  f.ordinate_axis = read_axis(lines);
  f.denominator_axis = read_axis(lines);
  read_axis(lines);
  distribute(binary ? binary_values(lines, form, *binary) : text_values(lines, form), form, f);
  for (std::size_t k = 0; k < f.abscissa.size(); ++k)
    if (!std::isfinite(f.abscissa[k]) || !std::isfinite(std::abs(f.ordinate[k])))
      lines.fail("value {} of the dataset is not finite", k);
  return f;
}

std::vector<double> read_short_values(TextLines& lines, std::size_t count) {
  std::vector<double> values;
  while (values.size() < count) {
    Record record(lines, lines.next());
    if (record.at_end()) lines.fail("empty line; expected numbers");
    while (values.size() < count && !record.at_end()) values.push_back(record.number(13));
  }
  return values;
}

/// Reads modes only; other data at nodes are skipped.
std::optional<UffMode> read_mode(TextLines& lines) {
  UffMode mode;
  for (std::string& id : mode.id) id = utf8_of_text(trimmed(lines.next()));
  Record record(lines, lines.next());
  record.integer(10);  // model type
  const long long analysis = record.integer(10);
  record.text(20);
  mode.complex = record.integer(10) == 5;
  const long long per_node = record.integer(10);
  if ((analysis != 2 && analysis != 3 && analysis != 7) || per_node < 1 || per_node > 9)
    return std::nullopt;
  mode.values_per_node = static_cast<std::size_t>(per_node);
  Record numbers(lines, lines.next());
  const long long n_integers = numbers.integer(10), n_reals = numbers.integer(10);
  if (n_integers < 2 || n_integers > 10 || n_reals < (analysis == 2 ? 3 : 4) || n_reals > 12)
    lines.fail("{} integer and {} real parameters do not define a mode", n_integers, n_reals);
  numbers.integer(10);
  mode.number = static_cast<int>(numbers.integer(10));
  const std::vector<double> reals = read_short_values(lines, static_cast<std::size_t>(n_reals));
  if (analysis == 2) {
    mode.frequency_hz = reals[0];
    mode.modal_mass = reals[1];
    mode.damping_ratio = reals[2];
  } else {
    mode.pole_rad_s = {reals[0], reals[1]};
    mode.modal_a = {reals[2], reals[3]};
  }
  for (std::string_view line = lines.next(); trimmed(line) != kEdge; line = lines.next()) {
    mode.nodes.push_back(Record(lines, line).integer(10));
    const std::size_t parts = mode.complex ? 2 : 1;
    const std::vector<double> values = read_short_values(lines, parts * mode.values_per_node);
    for (std::size_t q = 0; q < values.size(); q += parts)
      mode.values.emplace_back(values[q], mode.complex ? values[q + 1] : 0.0);
  }
  return mode;
}

UffUnits read_units(TextLines& lines) {
  Record(lines, lines.next()).integer(10);  // code
  Record factors(lines, lines.next());
  const UffUnits units{factors.number(25), factors.number(25)};
  factors.number(25);  // of temperature
  if (!(units.length > 0.0) || !(units.force > 0.0)) lines.fail("unit factors must be positive");
  return units;
}

/// That of the data if the dataset line contains "58b".
std::optional<std::endian> byte_order(const TextLines& lines, std::string_view line) {
  if (line.size() < 7 || (line[6] != 'b' && line[6] != 'B')) return std::nullopt;
  Record record(lines, line.substr(7));
  const long long order = record.integer(6), format = record.integer(6);
  if (order != 1 && order != 2)
    lines.fail("unsupported byte order {}; expected 1 (little endian) or 2", order);
  if (format != 2)
    lines.fail("unsupported floating-point format {}; expected 2 (IEEE 754)", format);
  return order == 2 ? std::endian::big : std::endian::little;
}

void skip_to_edge(TextLines& lines) {
  while (!lines.at_end())
    if (trimmed(lines.next()) == kEdge) return;
}

void read_dataset(TextLines& lines, UffContent& content) {
  const std::string_view line = lines.next();
  const std::string number(trimmed(line.substr(0, 6)));
  if (number == "58") {
    content.functions.push_back(read_function(lines, byte_order(lines, line)));
  } else if (number == "55") {
    const std::optional<UffMode> mode = read_mode(lines);
    if (mode) {
      content.modes.push_back(*mode);
      return;  // its end has been read
    }
  } else if (number == "164") {
    content.units = read_units(lines);
  } else if (number == "151") {
    for (std::string* text : {&content.model_name, &content.description})
      *text = utf8_of_text(trimmed(lines.next()));
  } else if (!parse_number(number)) {
    lines.fail("got '{}'; expected the number of a dataset", trimmed(line));
  }
  skip_to_edge(lines);
}

}  // namespace

bool is_uff_name(const std::filesystem::path& file) {
  return file.extension() == ".unv" || file.extension() == ".uff";
}

UffContent read_uff(const std::filesystem::path& file) {
  TextLines lines(file);
  UffContent content;
  while (!lines.at_end()) {
    const std::string_view line = trimmed(lines.next());
    if (line.empty()) continue;
    if (line != kEdge)
      lines.fail(
          "got '{}'; expected '    -1' at the start of a dataset. Check that this is a "
          "universal file",
          line.substr(0, 40));
    read_dataset(lines, content);
  }
  return content;
}

}  // namespace stageid
