#include "frf/health_finding.hpp"

#include <algorithm>
#include <array>

namespace stageid {

const char* to_string(Severity severity) noexcept {
  constexpr std::array kNames = {"fault", "doubt", "not checked"};
  return kNames[static_cast<std::size_t>(severity)];
}

const char* to_string(Cause cause) noexcept {
  constexpr std::array kNames = {"dead",       "saturated",  "marked",      "late",
                                 "swapped",    "sign",       "scale",       "skew",
                                 "unrecorded", "controller", "rigid_body",  "excluded",
                                 "excitation", "inputs",     "incoherent",  "interpolation",
                                 "aperiodic",  "unsettled",  "uneven_noise"};
  return kNames[static_cast<std::size_t>(cause)];
}

bool any_fault(const std::vector<Finding>& findings) noexcept {
  return std::any_of(findings.begin(), findings.end(),
                     [](const Finding& f) { return f.severity == Severity::fault; });
}

}  // namespace stageid
