#include "tools/exchange/import/si_unit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>

#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

/// Value in `unit` = factor x value in the original unit.
struct SiUnit {
  std::string unit;
  double factor = 1.0;
};

struct KnownUnit {
  std::string_view text;
  std::string_view si;
  double factor = 1.0;
  bool takes_prefix = true;
};

constexpr std::string_view kSiUnits[] = {"m", "s", "A", "K", "rad", "Hz", "N",  "Nm",  "Pa", "J",
                                         "W", "C", "V", "F", "T",   "H",  "Wb", "ohm", "S"};
constexpr KnownUnit kOtherUnits[] = {{"1", "1", 1.0, false},
                                     {"kg", "kg", 1.0, false},
                                     {"Ohm", "ohm"},
                                     {"\u03a9", "ohm"},
                                     {"%", "1", 0.01, false},
                                     {"deg", "rad", std::numbers::pi / 180.0, false},
                                     {"\u00b0", "rad", std::numbers::pi / 180.0, false},
                                     {"arcsec", "rad", std::numbers::pi / 648000.0, false},
                                     {"min", "s", 60.0, false},
                                     {"in", "m", 0.0254, false},
                                     {"inch", "m", 0.0254, false},
                                     {"ft", "m", 0.3048, false},
                                     {"lbf", "N", 4.4482216152605, false},
                                     {"bar", "Pa", 1e5}};

std::optional<KnownUnit> known_unit(std::string_view text) {
  for (const std::string_view unit : kSiUnits)
    if (unit == text) return KnownUnit{unit, unit};
  for (const KnownUnit& unit : kOtherUnits)
    if (unit.text == text) return unit;
  return std::nullopt;
}

constexpr std::pair<std::string_view, double> kPrefixes[] = {
    {"f", 1e-15},     {"p", 1e-12}, {"n", 1e-9}, {"u", 1e-6}, {"\u00b5", 1e-6},
    {"\u03bc", 1e-6}, {"m", 1e-3},  {"c", 1e-2}, {"d", 1e-1}, {"h", 1e2},
    {"k", 1e3},       {"M", 1e6},   {"G", 1e9}};

std::optional<SiUnit> plain_unit(std::string_view text) {
  if (const auto unit = known_unit(text)) return SiUnit{std::string(unit->si), unit->factor};
  for (const auto& [prefix, factor] : kPrefixes) {
    if (!text.starts_with(prefix)) continue;
    const std::string_view rest = text.substr(prefix.size());
    const std::optional<KnownUnit> unit = known_unit(rest);
    // Kiloseconds are not used, and Gs is gauss.
    if (unit && unit->takes_prefix && !(rest == "s" && factor > 1.0))
      return SiUnit{std::string(unit->si), factor * unit->factor};
    if (rest == "g") return SiUnit{"kg", 1e-3 * factor};
  }
  return std::nullopt;
}

/// "s^2", "s2", "s\u00b2": unit and exponent.
std::optional<SiUnit> powered_unit(std::string_view text) {
  constexpr std::pair<std::string_view, int> kRaised[] = {{"\u00b2", 2}, {"\u00b3", 3}};
  std::string_view base = text;
  int exponent = 1;
  for (const auto& [raised, value] : kRaised)
    if (text.ends_with(raised)) {
      base = text.substr(0, text.size() - raised.size());
      exponent = value;
    }
  if (base.size() > 1 && base.back() >= '2' && base.back() <= '4') {
    exponent = base.back() - '0';
    base.remove_suffix(1);
    if (base.ends_with('^')) base.remove_suffix(1);
  }
  std::optional<SiUnit> unit = plain_unit(base);
  if (!unit || exponent == 1) return unit;
  return SiUnit{fmt::format("{}^{}", unit->unit, exponent), std::pow(unit->factor, exponent)};
}

SiUnit si_unit(const std::string& place, const std::string& text) {
  SiUnit out;
  out.unit.clear();
  bool divides = false;
  std::size_t at = 0;
  while (at <= text.size()) {
    const std::size_t end = std::min(text.find_first_of("/*.", at), text.size());
    const std::string word = text.substr(at, end - at);
    if (word == "g")
      fail_request(
          "{}: unit '{}': 'g' is ambiguous: gram or acceleration of gravity. Write kg, or m/s^2 "
          "with scale: 9.80665 per channel",
          place, text);
    const std::optional<SiUnit> unit = powered_unit(word);
    if (!unit) return {text, 1.0};
    out.unit += unit->unit;
    out.factor *= divides ? 1.0 / unit->factor : unit->factor;
    if (end == text.size()) break;
    out.unit += text[end];
    divides = text[end] == '/';
    at = end + 1;
  }
  if (out.factor == 1.0) return {text, 1.0};  // unchanged
  return out;
}

}  // namespace

std::vector<double> take_si_units(const std::string& place, ChannelList& channels,
                                  std::vector<std::string>& notes) {
  std::vector<double> factors;
  for (std::string& unit : channels.units) {
    const SiUnit si = si_unit(place, unit);
    factors.push_back(si.factor);
    if (si.unit == unit) continue;
    std::string note =
        fmt::format("{}: {} converted to {}, factor {:.10g}", place, unit, si.unit, si.factor);
    if (std::ranges::find(notes, note) == notes.end()) notes.push_back(std::move(note));
    unit = si.unit;
  }
  return factors;
}

void take_si_units(FrfEstimate& frf, std::vector<std::string>& notes) {
  std::vector<std::string> own;
  const std::vector<double> outputs = take_si_units("outputs", frf.outputs, own);
  const std::vector<double> inputs = take_si_units("inputs", frf.inputs, own);
  if (own.empty()) return;
  if (frf.residual_covariance.size() > 0 || frf.covariance.size() > 0 ||
      frf.input_factor.size() > 0 || frf.detection.frequency_hz.size() > 0 ||
      frf.nonlinearity.band_hz.size() > 0)
    fail_request(
        "{}; its covariances and nonlinearity test cannot be converted. Estimate it again from a "
        "log in SI units",
        own.front());
  for (Eigen::Index c = 0; c < frf.response.rows(); ++c) {
    const double factor = outputs[c % frf.n_outputs()] / inputs[c / frf.n_outputs()];
    frf.response.row(c) *= factor;
    if (frf.noise_variance.size() > 0) frf.noise_variance.row(c) *= factor * factor;
    if (frf.total_variance.size() > 0) frf.total_variance.row(c) *= factor * factor;
  }
  notes.insert(notes.end(), own.begin(), own.end());
}

}  // namespace stageid
