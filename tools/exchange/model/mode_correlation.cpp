#include "tools/exchange/model/mode_correlation.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <regex>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "tools/exchange/uff/uff_frf.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {
namespace {

constexpr double kLeastDamping = 1e-4;  // finite-element models may have zero

void require_modes(const std::filesystem::path& file, const UffContent& content) {
  if (content.modes.empty())
    throw FormatError(file, "",
                      "contains no mode shapes (dataset 55); to compare a frequency response, "
                      "convert it with 'stageid import' first");
}

/// Node and direction of an output in a universal file.
struct Place {
  long long node = 0;
  int direction = 0;  ///< 0 scalar; 1 to 3 X, Y, Z; 4 to 6 rotations
  double sign = 1.0;
};

Place place_of(const std::string& output, std::size_t position) {
  static const std::regex pattern(R"((\d{1,9})(?:([+-])(R?)([XYZ]))?)");
  std::smatch found;
  if (!std::regex_match(output, found, pattern))
    return {static_cast<long long>(position) + 1, uff_direction(output), 1.0};
  Place place{std::stoll(found[1]), 0, 1.0};
  if (!found[4].matched) return place;
  place.direction = 1 + found.str(4).front() - 'X' + (found.length(3) > 0 ? 3 : 0);
  place.sign = found.str(2) == "-" ? -1.0 : 1.0;
  return place;
}

std::optional<std::complex<double>> value_at(const UffMode& mode, const Place& place) {
  const auto node = std::ranges::find(mode.nodes, place.node);
  if (node == mode.nodes.end()) return std::nullopt;
  const auto axis = static_cast<std::size_t>(std::max(place.direction, 1)) - 1;
  const bool scalar = mode.values_per_node == 1;
  if (!scalar && (place.direction == 0 || axis >= mode.values_per_node)) return std::nullopt;
  const auto first = static_cast<std::size_t>(node - mode.nodes.begin()) * mode.values_per_node;
  return place.sign * mode.values.at(first + (scalar ? 0 : axis));
}

/// For an output without a direction, the only direction in which its node moves, if there is exactly one.
Place with_direction(Place place, const std::vector<UffMode>& modes) {
  if (place.direction != 0) return place;
  for (int direction = 1; direction <= 6; ++direction) {
    const bool moves = std::ranges::any_of(modes, [&](const UffMode& mode) {
      return mode.values_per_node > 1 &&
             value_at(mode, {place.node, direction, 1.0}).value_or(0.0) != 0.0;
    });
    if (moves && place.direction != 0) return {place.node, 0, place.sign};
    if (moves) place.direction = direction;
  }
  return place;
}

/// Frequency and damping only; the caller adds the shape.
ModeShape mode_of(const UffMode& mode) {
  ModeShape shape;
  shape.natural_frequency_hz = mode.frequency_hz;
  shape.damping_ratio = mode.damping_ratio;
  // A complex eigenvalue is given by its pole instead.
  if (const double omega = std::abs(mode.pole_rad_s); omega > 0.0) {
    shape.natural_frequency_hz = omega / (2.0 * std::numbers::pi);
    shape.damping_ratio = -mode.pole_rad_s.real() / omega;
  }
  return shape;
}

std::vector<double> alone(const std::vector<ModeShape>& modes, const std::vector<ModePair>& pairs,
                          std::size_t ModePair::*side) {
  std::vector<double> frequency_hz;
  for (std::size_t i = 0; i < modes.size(); ++i)
    if (std::ranges::count(pairs, i, side) == 0)
      frequency_hz.push_back(modes[i].natural_frequency_hz);
  return frequency_hz;
}

}  // namespace

ModeCorrelation correlate_modes(const AdditiveModel& model, const std::filesystem::path& file,
                                const UffContent& content) {
  require_modes(file, content);
  ModeCorrelation out;
  std::vector<Place> places;
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const Place place = with_direction(place_of(model.outputs.names[i], i), content.modes);
    if (!std::ranges::all_of(
            content.modes, [&](const UffMode& mode) { return value_at(mode, place).has_value(); }))
      continue;
    places.push_back(place);
    rows.push_back(static_cast<Eigen::Index>(i));
    out.outputs.push_back(model.outputs.names[i]);
  }
  if (places.empty())
    fail_format(file, "",
                "its mode shapes contain no output of the model ({}); outputs are matched to nodes "
                "1, 2, ... in order, or by node and direction, '12+Z'",
                fmt::join(model.outputs.names, ", "));
  const Eigen::VectorXcd alike = Eigen::VectorXcd::Ones(1);  // the file has no inputs
  for (const ModeShape& mode : mode_shapes(model)) {
    out.own.push_back(mode);
    out.own.back().output_shape = mode.output_shape(rows);
    out.own.back().input_shape = alike;
  }
  for (const UffMode& mode : content.modes) {
    out.other.push_back(mode_of(mode));
    Eigen::VectorXcd& shape = out.other.back().output_shape;
    shape.resize(std::ssize(places));
    for (std::size_t i = 0; i < places.size(); ++i) shape[i] = *value_at(mode, places[i]);
    out.other.back().input_shape = alike;
  }
  out.pairs = pair_modes(out.own, out.other);
  return out;
}

std::vector<ModeCandidate> candidates_of(const std::filesystem::path& file,
                                         const UffContent& content) {
  require_modes(file, content);
  std::vector<ModeCandidate> out;
  for (const UffMode& given : content.modes) {
    const ModeShape mode = mode_of(given);
    if (!(mode.natural_frequency_hz > 0.0)) continue;  // rigid body of a finite-element model
    out.push_back({mode.natural_frequency_hz, std::clamp(mode.damping_ratio, kLeastDamping, 1.0)});
  }
  if (out.empty()) throw FormatError(file, "", "contains no mode with a frequency above zero");
  std::ranges::stable_sort(out, {}, &ModeCandidate::frequency_hz);
  return out;
}

std::vector<std::string> correlation_lines(const ModeCorrelation& correlation) {
  std::vector<std::vector<std::string>> rows = {
      {"frequency/Hz", "file/Hz", "difference", "damping", "file", "MAC"}};
  for (const ModePair& pair : correlation.pairs) {
    const ModeShape& own = correlation.own[pair.first];
    const ModeShape& other = correlation.other[pair.second];
    rows.push_back({fmt::format("{:.4f}", own.natural_frequency_hz),
                    fmt::format("{:.4f}", other.natural_frequency_hz),
                    fmt::format("{:+.2g} %", 100.0 * pair.frequency_difference),
                    fmt::format("{:.5f}", own.damping_ratio),
                    fmt::format("{:.5f}", other.damping_ratio),
                    fmt::format("{:.4f}", pair.output_mac)});
  }
  std::vector<std::string> lines = table_lines(rows);
  const auto left = [&](const char* whose, const std::vector<double>& frequency_hz) {
    if (!frequency_hz.empty())
      lines.push_back(fmt::format("{} alone: {:.5g} Hz", whose, fmt::join(frequency_hz, ", ")));
  };
  left("model", alone(correlation.own, correlation.pairs, &ModePair::first));
  left("file", alone(correlation.other, correlation.pairs, &ModePair::second));
  lines.push_back(fmt::format("MAC over {}: {}", counted(correlation.outputs.size(), "output"),
                              fmt::join(correlation.outputs, ", ")));
  return lines;
}

Json correlation_json(const ModeCorrelation& correlation) {
  Json pairs = Json::array();
  for (const ModePair& pair : correlation.pairs) {
    const ModeShape& own = correlation.own[pair.first];
    const ModeShape& other = correlation.other[pair.second];
    pairs.push_back({{"frequency_hz", own.natural_frequency_hz},
                     {"other_frequency_hz", other.natural_frequency_hz},
                     {"damping_ratio", own.damping_ratio},
                     {"other_damping_ratio", other.damping_ratio},
                     {"mac", pair.output_mac}});
  }
  return {{"outputs", correlation.outputs},
          {"pairs", pairs},
          {"own_alone_hz", alone(correlation.own, correlation.pairs, &ModePair::first)},
          {"other_alone_hz", alone(correlation.other, correlation.pairs, &ModePair::second)}};
}

}  // namespace stageid
