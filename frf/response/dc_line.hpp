#pragma once

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Whether the first line is at 0 Hz, as in measurements with all DFT lines.
bool has_dc_line(const FrfEstimate& frf);

/// The estimate without the line at 0 Hz; unchanged if there is none. Fits and mode searches cannot use this line: a
/// rigid body has no response there, logarithmic frequency scales exclude it, and its noise is real instead of
/// circular.
/// @throws std::invalid_argument if it is the only line
FrfEstimate without_dc_line(FrfEstimate frf);

/// Message about the discarded line.
constexpr const char* kDcLineLeftOut =
    "the line at 0 Hz is ignored: a rigid body has no response there, and its noise differs from "
    "that of the other lines";

}  // namespace stageid
