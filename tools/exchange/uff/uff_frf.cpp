#include "tools/exchange/uff/uff_frf.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <numeric>
#include <sstream>

#include "acquisition/files/fail.hpp"
#include "tools/exchange/arrays/frf_arrays.hpp"
#include "tools/terminal/text_lines.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

constexpr const char* kFrequencies = "stageid frequency_hz";
constexpr const char* kNoiseVariance = "stageid noise_variance";
constexpr const char* kTotalVariance = "stageid total_variance";
constexpr const char* kOutput = "output: ";
constexpr const char* kInput = "input: ";
constexpr const char* kSettings = "stageid-frf";
constexpr long long kFirstInputNode = 1001;

/// Specific data type: units along an axis and about it, and the exponents of length and force.
struct Quantity {
  int type;
  const char* unit;
  const char* rotation_unit;
  int length, rotation_length, force;
};

constexpr Quantity kQuantities[] = {{8, "m", "rad", 1, 0, 0},
                                    {11, "m/s", "rad/s", 1, 0, 0},
                                    {12, "m/s^2", "rad/s^2", 1, 0, 0},
                                    {13, "N", "Nm", 0, 1, 1}};

/// Null if there is none.
const Quantity* quantity_of(int type) {
  for (const Quantity& quantity : kQuantities)
    if (quantity.type == type) return &quantity;
  return nullptr;
}

/// Of values that need not be complex.
std::vector<double> real_parts(const UffFunction& f) {
  std::vector<double> real;
  for (const std::complex<double>& value : f.ordinate) real.push_back(value.real());
  return real;
}

// Writing -----------------------------------------------------------------------------------------

UffAxis axis_of(const std::string& unit) {
  UffAxis axis{.unit = unit};
  for (const Quantity& quantity : kQuantities)
    if (unit == quantity.unit) axis.type = quantity.type;
  return axis;
}

std::string name_line(const char* head, const std::string& name) {
  constexpr std::size_t kMost = 72;
  if (name.size() > kMost)
    fail_request("channel '{}': names in a universal file have at most {} characters; shorten it",
                 name, kMost);
  return head + name;
}

/// The name in ASCII.
std::string entity_of(const std::string& name) {
  std::string entity;
  for (const char32_t point : code_points_of(name))
    entity += point >= 0x20 && point <= 0x7E ? static_cast<char>(point) : '_';
  return entity.substr(0, 10);
}

UffFunction channel_function(const FrfEstimate& frf, Eigen::Index i, Eigen::Index j) {
  const std::string& output = frf.outputs.name(i);
  const std::string& input = frf.inputs.name(j);
  UffFunction f;
  f.id[3] = name_line(kOutput, output);
  f.id[4] = name_line(kInput, input);
  f.response = {entity_of(output), i + 1, uff_direction(output)};
  f.reference = {entity_of(input), kFirstInputNode + j, uff_direction(input)};
  f.abscissa_axis = {18, {0, 0, 0}, "Hz"};
  f.ordinate_axis = axis_of(frf.outputs.unit(i));
  f.denominator_axis = axis_of(frf.inputs.unit(j));
  f.abscissa.assign(frf.frequency_hz.begin(), frf.frequency_hz.end());
  return f;
}

/// One function per channel. @param title empty: that of a response
template <typename Values>
void add_functions(const FrfEstimate& frf, const Values& values, const std::string& title,
                   UffContent& content) {
  for (Eigen::Index c = 0; c < values.rows(); ++c) {
    UffFunction f = channel_function(frf, c % frf.n_outputs(), c / frf.n_outputs());
    f.id[0] = title;
    if (title.empty()) {
      f.id[0] = fmt::format("FRF {} <- {}", f.id[3].substr(8), f.id[4].substr(7)).substr(0, 80);
      f.type = 4;
      f.complex = true;
    }
    const auto row = values.row(c);
    f.ordinate.assign(row.begin(), row.end());
    content.functions.push_back(std::move(f));
  }
}

UffFunction frequency_function(const FrfEstimate& frf) {
  UffFunction f;
  f.id[0] = kFrequencies;
  f.ordinate_axis = {18, {0, 0, 0}, "Hz"};
  f.ordinate.assign(frf.frequency_hz.begin(), frf.frequency_hz.end());
  f.abscissa.resize(f.ordinate.size());
  std::iota(f.abscissa.begin(), f.abscissa.end(), 0.0);
  return f;
}

// Reading -----------------------------------------------------------------------------------------

std::string name_of(const UffFunction& f, const UffPoint& point, std::size_t id_line,
                    const char* head) {
  if (f.id[id_line].starts_with(head)) return f.id[id_line].substr(std::string(head).size());
  if (!point.entity.empty() && point.entity != "NONE" && point.node == 0) return point.entity;
  static constexpr const char* kAxes[] = {"", "X", "Y", "Z", "RX", "RY", "RZ"};
  const int axis = std::abs(point.direction) <= 6 ? std::abs(point.direction) : 0;
  return fmt::format("{}{}{}", point.node,
                     axis == 0             ? ""
                     : point.direction < 0 ? "-"
                                           : "+",
                     kAxes[axis]);
}

std::string output_name(const UffFunction& f) { return name_of(f, f.response, 3, kOutput); }
std::string input_name(const UffFunction& f) { return name_of(f, f.reference, 4, kInput); }

bool has_input(const UffFunction& f) {
  return f.type == 4 || (f.type != 1 && (f.reference.node != 0 || f.reference.entity != "NONE"));
}

/// Channel name of a function without input: many programs do not number nodes, and write the channel into the label
/// of the ordinate or the first id line.
std::string channel_name(const UffFunction& f) {
  if (f.response.node != 0 || f.response.entity != "NONE") return output_name(f);
  for (const std::string* text : {&f.ordinate_axis.label, &f.id[0]})
    if (!text->empty() && *text != "NONE") return *text;
  return output_name(f);
}

/// Factor between file units and the SI unit for a quantity of this axis; empty if unknown.
std::optional<double> factor_of(const UffAxis& axis, int direction, const UffUnits& units) {
  if (units.length == 1.0 && units.force == 1.0) return 1.0;
  const auto factor = [&](int length, int force) {
    return std::pow(units.length, length) * std::pow(units.force, force);
  };
  if (axis.type == 1) return factor(axis.exponents[0], axis.exponents[1]);
  const Quantity* quantity = quantity_of(axis.type);
  if (quantity == nullptr) return std::nullopt;
  return factor(std::abs(direction) > 3 ? quantity->rotation_length : quantity->length,
                quantity->force);
}

std::string unit_of(const UffAxis& axis, int direction, bool other_units) {
  if (axis.unit != "NONE" && !other_units) return axis.unit;
  const Quantity* quantity = quantity_of(axis.type);
  if (quantity == nullptr) return "1";
  return std::abs(direction) > 3 ? quantity->rotation_unit : quantity->unit;
}

/// Description of a file without frequency response, and the remedy.
std::string other_content(const UffContent& content) {
  static const std::map<int, const char*> kNames = {
      {1, "time response"}, {2, "auto spectrum"},          {3, "cross spectrum"},
      {6, "coherence"},     {9, "power spectral density"}, {12, "spectrum"}};
  std::map<std::string, int> counts;
  bool time = false;
  for (const UffFunction& f : content.functions) {
    const auto name = kNames.find(f.type);
    ++counts[name != kNames.end() ? name->second : fmt::format("function of type {}", f.type)];
    time = time || f.type == 1;
  }
  if (!content.modes.empty()) counts["mode shape"] = static_cast<int>(content.modes.size());
  std::string text;
  for (const auto& [name, count] : counts)
    text += fmt::format("{}{} x {}", text.empty() ? " but " : ", ", count, name);
  if (time) text += "; import time responses with a map (--map, 'kind: log', docs/exchange.md)";
  if (!content.modes.empty())
    text += "; import the modes with '-o modes.json', or compare them with 'validate MODEL FILE'";
  if (!time && content.modes.empty()) text += "; export frequency responses from the other program";
  return text;
}

[[noreturn]] void fail(const std::filesystem::path& file, const UffFunction& f,
                       const std::string& what) {
  fail_format(file, fmt::format("{}", f.line), "{} <- {}: {}", output_name(f), input_name(f), what);
}

void read_settings(const std::string& description, FrfEstimate& frf) {
  std::istringstream words(description);
  std::string title, hold, compensated, rate, delay;
  words >> title >> hold >> compensated >> rate >> delay;
  if (title != kSettings) return;
  frf.hold = from_word<Hold>(hold).value_or(Hold::none);
  frf.compensated = from_word<Compensation>(compensated).value_or(Compensation::none);
  frf.sample_rate_hz = parse_number(rate).value_or(0.0);
  frf.delay_s = parse_number(delay).value_or(0.0);
}

using Channel = std::pair<Eigen::Index, Eigen::Index>;

/// The functions of one kind by channel; every pair must occur once.
std::map<Channel, const UffFunction*> table_of(const std::filesystem::path& file,
                                               const UffContent& content, FrfEstimate& frf,
                                               const std::string& title) {
  std::map<Channel, const UffFunction*> table;
  const bool other_units = content.units.length != 1.0 || content.units.force != 1.0;
  const UffFunction* first = nullptr;
  for (const UffFunction& f : content.functions) {
    if (title.empty() ? f.type != 4 : f.id[0] != title) continue;
    const Channel channel = {
        place_in(frf.outputs, output_name(f),
                 unit_of(f.ordinate_axis, f.response.direction, other_units)),
        place_in(frf.inputs, input_name(f),
                 unit_of(f.denominator_axis, f.reference.direction, other_units))};
    if (!table.emplace(channel, &f).second)
      fail(file, f, "duplicate frequency response; keep one per channel");
    if (first == nullptr) first = &f;
    if (f.abscissa != first->abscissa)
      fail(file, f, "its frequencies differ from those of the first channel");
  }
  if (first != nullptr && table.size() != frf.outputs.size() * frf.inputs.size())
    fail_format(file, "", "got {} channels for {} outputs and {} inputs; every pair is required",
                table.size(), frf.outputs.size(), frf.inputs.size());
  return table;
}

double scale_to_si(const std::filesystem::path& file, const UffFunction& f, const UffUnits& units) {
  const std::optional<double> numerator = factor_of(f.ordinate_axis, f.response.direction, units);
  const std::optional<double> denominator =
      factor_of(f.denominator_axis, f.reference.direction, units);
  if (!numerator || !denominator)
    fail(file, f,
         "the units are not SI and the data types are unspecified; convert the file to SI first");
  return *denominator / *numerator;
}

std::vector<double> frequencies_of(const UffContent& content, const UffFunction& first) {
  for (const UffFunction& f : content.functions)
    if (f.id[0] == kFrequencies && f.ordinate.size() == first.abscissa.size()) return real_parts(f);
  return first.abscissa;
}

Eigen::MatrixXd variance_of(const std::filesystem::path& file, const UffContent& content,
                            const FrfEstimate& frf, const char* title) {
  FrfEstimate same = frf;
  const auto table = table_of(file, content, same, title);
  if (table.empty() || !(same.outputs == frf.outputs) || !(same.inputs == frf.inputs)) return {};
  Eigen::MatrixXd variance(frf.response.rows(), frf.lines());
  for (const auto& [channel, f] : table)
    for (Eigen::Index k = 0; k < frf.lines(); ++k)
      variance(channel.first + frf.n_outputs() * channel.second, k) = f->ordinate.at(k).real();
  return variance;
}

}  // namespace

int uff_direction(const std::string& name) {
  const std::size_t place = std::string("xyz").find(static_cast<char>(name[0] | 0x20));
  return place == std::string::npos ? 0 : static_cast<int>(place) + 1;
}

UffContent uff_of_frf(const FrfEstimate& frf) {
  UffContent content;
  content.model_name = "stageid frequency response";
  content.description = fmt::format("{} {} {} {} {}", kSettings, to_string(frf.hold),
                                    to_string(frf.compensated), frf.sample_rate_hz, frf.delay_s);
  add_functions(frf, frf.response, "", content);
  content.functions.push_back(frequency_function(frf));
  add_functions(frf, frf.noise_variance, kNoiseVariance, content);
  add_functions(frf, frf.total_variance, kTotalVariance, content);
  return content;
}

FrfEstimate frf_of_uff(const std::filesystem::path& file, const UffContent& content) {
  FrfEstimate frf;
  read_settings(content.description, frf);
  const auto table = table_of(file, content, frf, "");
  if (table.empty())
    throw FormatError(
        file, "",
        "contains no frequency response (dataset 58, function type 4)" + other_content(content));
  const UffFunction& first = *table.begin()->second;
  const std::vector<double> frequency = frequencies_of(content, first);
  const auto lines = std::ssize(frequency);
  frf.frequency_hz = Eigen::Map<const Eigen::VectorXd>(frequency.data(), lines);
  frf.response.resize(frf.n_outputs() * frf.n_inputs(), lines);
  for (const auto& [channel, f] : table) {
    const double scale = scale_to_si(file, *f, content.units);
    frf.response.row(channel.first + frf.n_outputs() * channel.second) =
        scale * Eigen::Map<const Eigen::RowVectorXcd>(f->ordinate.data(), lines);
  }
  frf.noise_variance = variance_of(file, content, frf, kNoiseVariance);
  frf.total_variance = variance_of(file, content, frf, kTotalVariance);
  return frf;
}

ArrayList arrays_of_uff(const std::filesystem::path& file, const UffContent& content) {
  ArrayList list{file, {}};
  std::map<std::string, int> seen;  // several measurements of one channel
  for (const UffFunction& f : content.functions) {
    const std::string channel =
        has_input(f) ? fmt::format("{}<-{}", output_name(f), input_name(f)) : channel_name(f);
    const int before = seen[channel]++;
    const std::string name = before == 0 ? channel : fmt::format("{} ({})", channel, before + 1);
    NamedArray array{name, {f.ordinate.size()}, f.ordinate};
    if (!f.complex) array.values = real_parts(f);
    list.arrays.push_back(std::move(array));
    list.arrays.push_back({name + "@abscissa", {f.abscissa.size()}, f.abscissa});
  }
  return list;
}

}  // namespace stageid
