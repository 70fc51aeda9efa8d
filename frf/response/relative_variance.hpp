#pragma once

#include "frf/response/confidence.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Relative variance of a response as one number:
///   mean over lines k and outputs i of  sum_j var G_ij(k) / sum_j |G_ij(k)|^2.
/// Rows are not mixed, because outputs may differ in unit. Zeros of single entries do not dominate it.
/// @throws std::invalid_argument if the variance is unknown, or an output is zero on a line.
double mean_relative_variance(const FrfEstimate& frf, VarianceKind kind);

}  // namespace stageid
