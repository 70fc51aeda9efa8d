#pragma once

#include <string>

#include "frf/frf_estimate.hpp"

namespace stageid {

/// A frequency response as a table: one line a frequency; frequency_hz, then of every channel, outputs
/// first, "real OUTPUT/INPUT [m/N]" and "imaginary ...", and as far as they are known
/// "noise_variance ... [(m/N)^2]" and "total_variance ...", E|error|^2 of the complex response. Lines that
/// begin with # tell format and realizations. Numbers are the shortest that read back to the same double.
std::string frf_csv(const FrfEstimate& frf);

}  // namespace stageid
