#pragma once

#include <string>

namespace stageid {

/// A run whose noise is not that of the other experiments of its realization.
struct NoisyRun {
  int realization = 0;  ///< counted from 0
  int experiment = 0;   ///< the same
  std::string output;   ///< where it differs most
  double ratio = 1.0;   ///< its noise power there over the median of the experiments
};

}  // namespace stageid
