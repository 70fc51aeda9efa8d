#pragma once

#include "frf/response/confidence.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// One number for how well a response is known:
///   mean over lines k and outputs i of  sum_j var G_ij(k) / sum_j |G_ij(k)|^2.
/// Rows are not mixed, as outputs may differ in unit, and zeros of single entries do not blow it up.
/// @throws std::invalid_argument if the estimate has no such variance, or an output is zero on a line.
double mean_relative_variance(const FrfEstimate& frf, VarianceKind kind);

}  // namespace stageid
