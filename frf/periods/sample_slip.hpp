#pragma once

#include <cstdint>
#include <string>

#include "frf/periods/health_finding.hpp"

namespace stageid {

/// A position in a run where samples were lost or duplicated.
struct SampleSlip {
  std::string run{};    ///< name of the run in the log
  int realization = 0;  ///< counted from 0
  int experiment = 0;
  std::uint64_t row = 0;  ///< of the run, as recorded, 0-based: the first one after the gap
  int lost = 0;           ///< samples; < 0: duplicated
  bool sensors = true;    ///< affected channels
  bool actuators = true;
  std::string channel{};  ///< the only affected one; empty: all channels of these kinds
  bool spoilt = true;     ///< its period is discarded; false: the gap is between two periods
};

/// "one sample lost near row 21234"
std::string to_string(const SampleSlip& slip);
Finding to_finding(const SampleSlip& slip);

}  // namespace stageid
