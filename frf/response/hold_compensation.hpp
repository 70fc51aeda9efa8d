#pragma once

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Takes delay, or delay and zero-order hold, out of a measured response:
///   delay:  G e^{+j omega (delay_s + T/2)}
///   hold:   G e^{+j omega delay_s} (j omega T) / (1 - e^{-j omega T})
/// Variances follow. Aliasing stays (method.md section 4).
/// @throws std::invalid_argument if frf was compensated already or its sample rate is unknown.
FrfEstimate compensate(const FrfEstimate& frf, Compensation kind, double delay_s);

/// The response as it was measured: puts back what compensate() took out, so that a model can go
/// through hold, delay and sampler exactly instead of meeting data in which the aliasing was left.
/// @throws std::invalid_argument if nothing was taken out or the sample rate is unknown.
FrfEstimate as_measured(FrfEstimate frf);

}  // namespace stageid
