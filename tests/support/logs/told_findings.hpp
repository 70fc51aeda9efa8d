#pragma once

#include <string>
#include <vector>

#include "frf/periods/health_finding.hpp"

namespace stageid::test {

/// Without the properties that were not checked.
inline std::vector<Finding> told(std::vector<Finding> findings) {
  std::erase_if(findings, [](const Finding& f) { return f.severity == Severity::unchecked; });
  return findings;
}

/// One finding per line, for failures of tests.
inline std::string text(const std::vector<Finding>& findings) {
  std::string all;
  for (const Finding& f : findings) all += f.channel + " " + f.what + " (" + f.figure + ")\n";
  return all;
}

}  // namespace stageid::test
