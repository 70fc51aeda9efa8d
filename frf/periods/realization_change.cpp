#include "frf/periods/realization_change.hpp"

#include <fmt/format.h>

#include <cmath>

namespace stageid {
namespace {

constexpr double kDeadGain = 0.05;

}  // namespace

std::string with_deviation(double value, double deviation, int digits) {
  return deviation > 0.0 ? fmt::format("{:.4g} +- {:.1g}", value, deviation)
                         : fmt::format("{:.{}g}", value, digits);
}

Finding to_finding(const RealizationChange& change) {
  const bool two = change.other >= 0;
  const int number = change.realization + 1;
  const std::string where =
      two ? fmt::format("in realization {} than in realization {}, one of which is wrong", number,
                        change.other + 1)
          : fmt::format("in realization {} than in the others", number);
  Finding finding{
      Severity::fault, Cause::swapped,
      change.channel,  "",
      "exchanged",     "leave the wrong realization out (--realizations), or measure it again"};
  if (two) finding.realizations.push_back(change.other);
  finding.realizations.push_back(change.realization);
  switch (change.kind) {
    case RealizationChange::Kind::gain: {
      const bool dead = std::abs(change.value) < kDeadGain;
      finding.cause = dead ? Cause::dead : change.value < 0.0 ? Cause::sign : Cause::scale;
      finding.what = fmt::format("{} {}",
                                 dead                 ? "responds less"
                                 : change.value < 0.0 ? "has another sign"
                                                      : "has another scale",
                                 where);
      finding.figure = fmt::format("factor {}", with_deviation(change.value, change.deviation, 4));
      break;
    }
    case RealizationChange::Kind::skew:
      finding.cause = Cause::skew;
      finding.what = fmt::format("{} {}", change.value > 0.0 ? "later" : "earlier", where);
      finding.figure = fmt::format("{} us", with_deviation(kMicroseconds * std::abs(change.value),
                                                           kMicroseconds * change.deviation, 4));
      break;
    case RealizationChange::Kind::swap:
      finding.what = two ? fmt::format("exchanged in realization {} or realization {}", number,
                                       change.other + 1)
                         : fmt::format("exchanged in realization {} only", number);
      break;
  }
  return finding;
}

Finding to_finding(const PlantChange& change) {
  const std::string which =
      change.realizations.empty() ? "some realizations" : named_realizations(change.realizations);
  return {change.ratio > kMisleading ? Severity::fault : Severity::doubt,
          Cause::drift,
          "",
          fmt::format("the stage changed during the measurement: {} {} from the others", which,
                      change.realizations.size() == 1 ? "differs" : "differ"),
          fmt::format("{:.2g} times the noise at {:.4g} ... {:.4g} Hz, alike on neighbouring lines "
                      "(p = {:.0e})",
                      change.ratio, change.low_hz, change.high_hz, change.p_value),
          "find out what changed: load, clamping, gain, temperature; leave the realizations before "
          "or after the change out (--realizations), or measure again",
          change.realizations};
}

}  // namespace stageid
