#pragma once

#include "frf/periods/health_finding.hpp"

namespace stageid {

/// A mode whose frequency changes during the measurement.
struct ModeDrift {
  double frequency_hz = 0.0;
  double change = 0.0;     ///< of its frequency, relative, from the first run to the last
  double deviation = 0.0;  ///< standard deviation of `change`
  double bias = 0.0;  ///< half the change of the response over its stated deviation, at the maximum
  bool in_total = false;  ///< there are several realizations, so the total variance contains it
};
Finding to_finding(const ModeDrift& drift);

}  // namespace stageid
