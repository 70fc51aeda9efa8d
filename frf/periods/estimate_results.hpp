#pragma once

#include <optional>
#include <string>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/periods/realization_change.hpp"

namespace stageid {

/// A mode whose frequency changes during the measurement.
struct ModeDrift {
  double frequency_hz = 0.0;
  double change = 0.0;     ///< of its frequency, relative: over the realizations, or within a run
  double deviation = 0.0;  ///< standard deviation of `change`
  double bias = 0.0;  ///< half the change of the response over its stated deviation, at the maximum
  bool within_runs = false;  ///< seen within the runs, not between the realizations
  bool in_total = false;     ///< there are several realizations, so the total variance contains it
};
Finding to_finding(const ModeDrift& drift);

/// A run whose noise differs from that of the other experiments of its realization.
struct NoisyRun {
  int realization = 0;  ///< counted from 0
  int experiment = 0;   ///< the same
  std::string output;   ///< with the largest difference
  double ratio = 1.0;   ///< its noise power there over the median of the experiments
};

/// What only an estimate shows about the logs; empty without one.
struct EstimateResults {
  std::optional<ModeDrift> drift;
  std::vector<NoisyRun> noisy_runs;
  RealizationDifferences differences;
};

}  // namespace stageid
