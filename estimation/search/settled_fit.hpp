#pragma once

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The last fit of a search that chose the modes itself. Where the iteration does not converge, searched
/// modes are given up, one after the other, until it does. First one of two that have run into each other: they
/// overlap, and are less apart than the deviation of either frequency. Then the one that the data leave most open,
/// whose standard deviation is largest in units of itself, be it of the damping ratio or of the frequency in
/// half-power widths. If none of these fits converges, or only at one and a half times the cost, the first one is returned, as it is.
/// Of a fit that converges, undetermined_modes() are left out that are not worth their parameters (BIC).
/// @returns with a line in FitResult::decisions for each mode given up
/// @throws std::invalid_argument: as fit_additive_model()
FitResult settled_fit(const FrfEstimate& frf, const AdditiveModel& start,
                      const FitOptions& options);

}  // namespace stageid
