#include "frf/periods/health_finding.hpp"

#include <algorithm>

#include "acquisition/files/counted.hpp"

namespace stageid {
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
  return std::ranges::find(findings, Severity::fault, &Finding::severity) != findings.end();
}

}  // namespace stageid
