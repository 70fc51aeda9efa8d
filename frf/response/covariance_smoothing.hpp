#pragma once

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The noise covariance as the mean over neighbouring lines, for noise whose spectrum changes little
/// over `lines` of them:
///   C_E(k) = mean over the `lines` lines around k of C_E,   Cov(vec G)(k) = S(k) kron C_E(k),
/// with the line's own S (input_factor): the inputs' spectrum is not smoothed. Within `lines` of an
/// end of the band the window stays inside and does not shrink, so that noise_dof, which grows by
/// the factor `lines`, holds on every line. total_variance, which rests on few realizations but
/// holds distortions as well, and detection stay.
/// Replaces noise_variance, residual_covariance, covariance (if there), noise_dof, covariance_lines.
/// Source: facts 8 (weights must not depend on the same noise per line); DFT lines of stationary
/// noise are independent: Brillinger, Time Series (2001), theorem 4.4.1.
/// @throws std::invalid_argument unless `lines` is odd, positive and no more than there are; if C_E or
///         S are unknown; if C_E is smooth already (lpm, zippered, or smoothed).
FrfEstimate smooth_covariance(const FrfEstimate& frf, int lines);

}  // namespace stageid
