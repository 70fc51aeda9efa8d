#pragma once

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Replaces the noise covariance by the mean over neighbouring lines, for noise whose spectrum changes little over
/// `lines` of them:
///   C_E(k) = mean over the `lines` lines around k of C_E,   Cov(vec G)(k) = S(k) kron C_E(k),
/// with the line's own S (input_factor), so the inputs' spectrum is not smoothed. Near an end of the band the window
/// is shifted, not shortened, so that noise_dof, which grows by the factor `lines`, is valid on every line.
/// total_variance and detection are unchanged: distortions vary over the lines.
/// Replaces noise_variance, residual_covariance, covariance (if present), noise_dof, covariance_lines.
/// Source: DFT lines of stationary noise are independent: Brillinger, Time Series (2001), theorem 4.4.1.
/// @throws std::invalid_argument unless `lines` is odd, positive and at most the number of lines; if C_E or
///         S are unknown; if C_E is smooth already (lpm, zippered, or smoothed).
FrfEstimate smooth_covariance(const FrfEstimate& frf, int lines);

}  // namespace stageid
