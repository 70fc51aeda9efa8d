#pragma once

#include "frf/periods/health_finding.hpp"

namespace stageid {

/// A mode whose frequency moves while it is measured.
struct ModeDrift {
  double frequency_hz = 0.0;
  double change = 0.0;     ///< of its frequency, relative, from the first run to the last
  double deviation = 0.0;  ///< of `change`
  double bias =
      0.0;  ///< half the change of the response there over its stated deviation, where that is most
  bool in_total = false;  ///< realizations were measured, so that the total variance contains it
};
Finding to_finding(const ModeDrift& drift);

}  // namespace stageid
