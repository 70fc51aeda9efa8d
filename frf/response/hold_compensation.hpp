#pragma once

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Removes delay, or delay and zero-order hold, from a measured response:
///   delay:  G e^{+j omega (delay_s + T/2)}
///   hold:   G e^{+j omega delay_s} (j omega T) / (1 - e^{-j omega T})
/// Variances are scaled accordingly. Aliasing remains (docs/theory.md, section 6).
/// @throws std::invalid_argument if frf was compensated already or its sample rate is unknown.
FrfEstimate compensate(const FrfEstimate& frf, Compensation kind, double delay_s);

/// The response as measured: inverts compensate(), so that a model can pass through hold, delay and sampler exactly.
/// Compensated data would still contain the aliasing.
/// @throws std::invalid_argument if nothing was compensated or the sample rate is unknown.
FrfEstimate as_measured(FrfEstimate frf);

}  // namespace stageid
