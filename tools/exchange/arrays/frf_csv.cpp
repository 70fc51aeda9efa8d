#include "tools/exchange/arrays/frf_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <type_traits>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/files/version.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/exchange/arrays/frf_arrays.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/text_lines.hpp"

namespace stageid {
namespace {

/// Calls visit(part, matrix, square) for the columns of a channel that have values: the part of their title, and
/// whether they have the square of its unit.
template <typename Frf, typename Visit>
void for_each_column(Frf& frf, Visit visit) {
  visit("real", frf.response.real(), false);
  visit("imaginary", frf.response.imag(), false);
  if (frf.noise_variance.size() > 0) visit("noise_variance", frf.noise_variance, true);
  if (frf.total_variance.size() > 0) visit("total_variance", frf.total_variance, true);
}

std::string title_of(const FrfEstimate& frf, Eigen::Index channel, const char* part, bool square) {
  const Eigen::Index i = channel % frf.n_outputs(), j = channel / frf.n_outputs();
  const std::string unit = frf.outputs.unit(i) + "/" + frf.inputs.unit(j);
  return fmt::format("{} {}/{} [{}]", part, frf.outputs.name(i), frf.inputs.name(j),
                     square ? fmt::format("({})^2", unit) : unit);
}

std::string head_of(const FrfEstimate& frf) {
  std::string text = "frequency_hz";
  for (Eigen::Index c = 0; c < frf.response.rows(); ++c)
    for_each_column(frf, [&](const char* part, const auto& /*values*/, bool square) {
      text.append(1, ',').append(csv_field(title_of(frf, c, part, square)));
    });
  return text;
}

/// Calls visit(key, value) for the properties that are not in the columns, so that the table can be read without a
/// map.
template <typename Frf, typename Visit>
void for_each_property(Frf& frf, Visit visit) {
  visit("outputs", frf.outputs.names);
  visit("output_units", frf.outputs.units);
  visit("inputs", frf.inputs.names);
  visit("input_units", frf.inputs.units);
  visit("sample_rate_hz", frf.sample_rate_hz);
  visit("hold", frf.hold);
  visit("compensated", frf.compensated);
  visit("delay_s", frf.delay_s);
  visit("realizations", frf.realizations);
  visit("periods", frf.periods);
  visit("experiments", frf.experiments);
  visit("noise_dof", frf.noise_dof);
  visit("total_dof", frf.total_dof);
  visit("correlated_lines", frf.correlated_lines);
}

std::string description_of(const FrfEstimate& frf) {
  Json json;
  json["format"] = "stageid-frf";
  for_each_property(frf, [&json](const char* key, const auto& value) {
    if constexpr (std::is_enum_v<std::decay_t<decltype(value)>>)
      json[key] = to_string(value);
    else
      json[key] = value;
  });
  return json_line(json);
}

constexpr std::string_view kDescription = "# {\"format\":\"stageid-frf\"";

/// Names and units from the titles of a table without a description: "real z1/a1 [m/N]". The part after the last slash
/// is the unit of the input.
bool channels_from_head(const ArrayList& arrays, FrfEstimate& frf) {
  const auto add = [](ChannelList& list, const std::string& name, const std::string& unit) {
    return list.unit(place_in(list, name, unit)) == unit;
  };
  bool plain = true;
  for (const NamedArray& array : arrays.arrays) {
    if (!array.name.starts_with("real ") || !array.name.ends_with("]")) continue;
    const std::size_t bracket = array.name.rfind(" [");
    if (bracket == std::string::npos || bracket < 5) return false;
    const std::string channel = array.name.substr(5, bracket - 5);
    const std::string unit = array.name.substr(bracket + 2, array.name.size() - bracket - 3);
    const std::size_t slash = channel.find('/'), unit_slash = unit.rfind('/');
    plain = plain && slash != std::string::npos && channel.rfind('/') == slash &&
            unit_slash != std::string::npos &&
            add(frf.outputs, channel.substr(0, slash), unit.substr(0, unit_slash)) &&
            add(frf.inputs, channel.substr(slash + 1), unit.substr(unit_slash + 1));
  }
  return plain && frf.outputs.size() > 0;
}

/// @throws SortedJson::exception for other types
void read_description(const SortedJson& json, FrfEstimate& frf) {
  for_each_property(frf, [&json](const char* key, auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if constexpr (std::is_enum_v<Value>)
      value = from_word<Value>(json.value(key, "")).value_or(Value{});
    else if (json.contains(key))
      value = json.at(key).get<Value>();
  });
}

/// The comment that describes the table, and the titles of its columns; empty if there is none.
std::pair<std::string, std::string> head_in(const std::filesystem::path& file) {
  TextLines lines(file);
  std::string description;
  while (!lines.at_end()) {
    const std::string_view line = lines.next();
    if (!trimmed(line).empty() && !line.starts_with('#')) return {description, std::string(line)};
    if (description.empty() && line.starts_with(kDescription)) description = line.substr(2);
  }
  return {description, ""};
}

void describe(const ArrayList& arrays, FrfEstimate& frf) {
  const std::string text = head_in(arrays.file).first;
  if (text.empty()) {
    if (!channels_from_head(arrays, frf))
      arrays.fail("",
                  "names and units of its channels contain slashes and cannot be separated. "
                  "Write a map with kind: frf and channels (docs/exchange.md)");
    return;
  }
  try {
    read_description(parse_json<SortedJson>(text), frf);
  } catch (const SortedJson::exception&) {
    arrays.fail("",
                "its line '# {{\"format\":...}}' is damaged. Remove that line, or export the "
                "response again");
  }
  if (frf.outputs.units.size() != frf.outputs.size() ||
      frf.inputs.units.size() != frf.inputs.size())
    arrays.fail("", "expected one unit per channel; export the response again");
}

}  // namespace

bool is_frf_csv(const std::filesystem::path& file) {
  if (file.extension() != ".csv") return false;
  const std::string titles = head_in(file).second;
  return titles.starts_with("frequency_hz,") && titles.find("real ") != std::string::npos &&
         titles.find("imaginary ") != std::string::npos;
}

FrfEstimate read_frf_csv(const std::filesystem::path& file) {
  const ArrayList arrays = read_csv(file);
  FrfEstimate frf;
  describe(arrays, frf);
  const auto column = [&](const std::string& name) {
    const std::vector<double>& values = real_values(arrays, arrays.at(name));
    if (frf.lines() > 0 && std::ssize(values) != frf.lines())
      arrays.fail(name, "got {}; expected {}", counted(values.size(), "value"),
                  counted(frf.lines(), "frequency", "frequencies"));
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values)));
  };
  frf.frequency_hz = column("frequency_hz");
  if (frf.lines() == 0) arrays.fail("frequency_hz", "is empty; expected at least one frequency");
  const auto has = [&](const char* part) {
    return std::ranges::any_of(arrays.arrays, [part](const NamedArray& array) {
      return array.name.starts_with(std::string(part) + " ");
    });
  };
  const Eigen::Index channels = frf.n_outputs() * frf.n_inputs();
  frf.response.resize(channels, frf.lines());
  if (has("noise_variance")) frf.noise_variance.resize(channels, frf.lines());
  if (has("total_variance")) frf.total_variance.resize(channels, frf.lines());
  for (Eigen::Index c = 0; c < channels; ++c)
    for_each_column(frf, [&](const char* part, auto&& values, bool square) {
      values.row(c) = column(title_of(frf, c, part, square)).transpose();
    });
  return frf;
}

std::string frf_csv(const FrfEstimate& frf) {
  std::string text = fmt::format(
      "# stageid-frf, written by stageid {}; sample rate {} Hz, realizations {}, periods {}\n"
      "# of OUTPUT/INPUT, SI units; variances are E|error|^2 of the complex response\n# {}\n{}\n",
      version(), frf.sample_rate_hz, frf.realizations, frf.periods, description_of(frf),
      head_of(frf));
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    text += fmt::format("{}", frf.frequency_hz[k]);
    for (Eigen::Index c = 0; c < frf.response.rows(); ++c)
      for_each_column(frf, [&](const char* /*part*/, const auto& values, bool /*square*/) {
        text += fmt::format(",{}", values(c, k));
      });
    text += '\n';
  }
  return text;
}

}  // namespace stageid
