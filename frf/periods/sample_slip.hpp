#pragma once

#include <cstdint>
#include <string>

#include "frf/periods/health_finding.hpp"

namespace stageid {

/// A place in a run where samples were lost, or written twice.
struct SampleSlip {
  std::string run{};    ///< its name in the log
  int realization = 0;  ///< counted from 0
  int experiment = 0;
  std::uint64_t row = 0;  ///< of the run, as recorded, from 0: the first one behind the place
  int lost = 0;           ///< samples; < 0: so many too many
  bool sensors = true;    ///< which channels
  bool actuators = true;
  bool spoilt = true;  ///< its period is left out; else it lies between two
};

/// "one sample lost near row 21234"
std::string to_string(const SampleSlip& slip);
Finding to_finding(const SampleSlip& slip);

}  // namespace stageid
