#include "frf/periods/realization_change.hpp"

#include <fmt/format.h>

#include <cmath>

namespace stageid {
namespace {

constexpr double kDeadGain = 0.05;
constexpr double kMicroseconds = 1e6;

std::string with_deviation(double value, double deviation) {
  return deviation > 0.0 ? fmt::format("{:.4g} +- {:.1g}", value, deviation)
                         : fmt::format("{:.4g}", value);
}

}  // namespace

Finding to_finding(const RealizationChange& change) {
  const bool two = change.other >= 0;
  Finding finding;
  finding.severity = Severity::fault;
  finding.channel = change.channel;
  finding.realizations = {change.realization};
  if (two) finding.realizations.insert(finding.realizations.begin(), change.other);
  const std::string where =
      two ? fmt::format("in realization {} than in realization {}, one of which is wrong",
                        change.realization + 1, change.other + 1)
          : fmt::format("in realization {} than in the others", change.realization + 1);
  switch (change.kind) {
    case RealizationChange::Kind::gain:
      finding.figure = fmt::format("factor {}", with_deviation(change.value, change.deviation));
      if (std::abs(change.value) < kDeadGain) {
        finding.cause = Cause::dead;
        finding.what = fmt::format("responds less {}", where);
      } else if (change.value < 0.0) {
        finding.cause = Cause::sign;
        finding.what = fmt::format("has another sign {}", where);
      } else {
        finding.cause = Cause::scale;
        finding.what = fmt::format("has another scale {}", where);
      }
      break;
    case RealizationChange::Kind::skew:
      finding.cause = Cause::skew;
      finding.what = fmt::format("{} {}", change.value > 0.0 ? "later" : "earlier", where);
      finding.figure = fmt::format("{} us", with_deviation(kMicroseconds * std::abs(change.value),
                                                           kMicroseconds * change.deviation));
      break;
    case RealizationChange::Kind::swap:
      finding.cause = Cause::swapped;
      finding.what = two ? fmt::format("exchanged in realization {} or realization {}",
                                       change.realization + 1, change.other + 1)
                         : fmt::format("exchanged in realization {} only", change.realization + 1);
      finding.figure = "exchanged";
      break;
  }
  finding.remedy = "leave the wrong realization out (--realizations), or measure it again";
  return finding;
}

}  // namespace stageid
