#pragma once

#include <string>

namespace stageid {

/// A run whose noise differs from that of the other experiments of its realization.
struct NoisyRun {
  int realization = 0;  ///< counted from 0
  int experiment = 0;   ///< the same
  std::string output;   ///< with the largest difference
  double ratio = 1.0;   ///< its noise power there over the median of the experiments
};

}  // namespace stageid
