#include "frf/periods/health_finding.hpp"

#include <algorithm>
#include <string_view>

#include "acquisition/files/counted.hpp"

namespace stageid {
namespace {

constexpr const char* kUnknown = "unknown";  // to_string() of unknown causes

}  // namespace

const char* to_string(Severity severity) noexcept {
  switch (severity) {
    case Severity::fault:
      return "fault";
    case Severity::doubt:
      return "doubt";
    case Severity::unchecked:
      return "not checked";
  }
  return "unknown";
}

const char* to_string(Cause cause) noexcept {
  switch (cause) {
    case Cause::dead:
      return "dead";
    case Cause::saturated:
      return "saturated";
    case Cause::marked:
      return "marked";
    case Cause::late:
      return "late";
    case Cause::swapped:
      return "swapped";
    case Cause::sign:
      return "sign";
    case Cause::scale:
      return "scale";
    case Cause::skew:
      return "skew";
    case Cause::unrecorded:
      return "unrecorded";
    case Cause::controller:
      return "controller";
    case Cause::rigid_body:
      return "rigid_body";
    case Cause::unknown_stage:
      return "unknown_stage";
    case Cause::injection:
      return "injection";
    case Cause::excluded:
      return "excluded";
    case Cause::excitation:
      return "excitation";
    case Cause::inputs:
      return "inputs";
    case Cause::incoherent:
      return "incoherent";
    case Cause::interpolation:
      return "interpolation";
    case Cause::aperiodic:
      return "aperiodic";
    case Cause::unsettled:
      return "unsettled";
    case Cause::uneven_noise:
      return "uneven_noise";
    case Cause::limit_cycle:
      return "limit_cycle";
    case Cause::lost_samples:
      return "lost_samples";
    case Cause::excitation_timing:
      return "excitation_timing";
    case Cause::drift:
      return "drift";
    case Cause::actuator_step:
      return "actuator_step";
  }
  return kUnknown;
}

std::optional<Cause> cause_of(std::string_view name) noexcept {
  for (int i = 0; to_string(static_cast<Cause>(i)) != std::string_view(kUnknown); ++i)
    if (to_string(static_cast<Cause>(i)) == name) return static_cast<Cause>(i);
  return std::nullopt;
}

std::string named_realizations(const std::vector<int>& realizations) {
  std::vector<std::string> numbers;
  for (const int m : realizations) numbers.push_back(std::to_string(m + 1));
  return (numbers.size() == 1 ? "realization " : "realizations ") + listed(numbers, kMostNamed);
}

int rank_of(const Finding& finding) noexcept {
  const bool fault = finding.severity == Severity::fault;
  // They cause other faults; a transient also makes the noise of runs differ.
  if (fault && (finding.cause == Cause::unsettled || finding.cause == Cause::limit_cycle)) return 0;
  if (fault) return 1;
  if (finding.cause == Cause::unknown_stage) return 2;
  if (finding.severity == Severity::unchecked) return 5;
  return finding.cause == Cause::uneven_noise ? 4 : 3;  // a transient or a drift looks like noise
}

bool any_fault(const std::vector<Finding>& findings) noexcept {
  return std::any_of(findings.begin(), findings.end(),
                     [](const Finding& f) { return f.severity == Severity::fault; });
}

}  // namespace stageid
