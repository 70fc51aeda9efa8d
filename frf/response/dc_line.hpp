#pragma once

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Whether the first line lies at 0 Hz, as a measurement with all lines of the DFT has it.
bool has_dc_line(const FrfEstimate& frf);

/// The other lines. A rigid body has no response at 0 Hz, the logarithmic scales of mode indicators have no place
/// for it, and its noise is real, not circular as all that weighs by variances takes for granted: no fit and no
/// search for modes uses it. As it is where there is none.
/// @throws std::invalid_argument if it is the only line
FrfEstimate without_dc_line(FrfEstimate frf);

/// What is said where it was left out.
constexpr const char* kDcLineLeftOut =
    "the line at 0 Hz is ignored: a rigid body has no response there, and its noise differs from "
    "that of the other lines";

}  // namespace stageid
