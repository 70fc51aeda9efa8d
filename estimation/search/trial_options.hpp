#pragma once

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// `options` for fits that are compared with each other: few iterations to the same minimum, free residues, the
/// weights computed once and diagonal, no standard deviations.
FitOptions trial_options(const FrfEstimate& frf, const FitOptions& options);

}  // namespace stageid
