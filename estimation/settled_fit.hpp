#pragma once

#include "estimation/fit_options.hpp"
#include "frf/frf_estimate.hpp"

namespace stageid {

/// The last fit of a search that chose the modes itself. Where the iteration does not converge, searched
/// modes that the data leave open are left out, one after the other, until it does: first the one whose
/// standard deviation is largest in units of itself, be it of the damping ratio or of the frequency in
/// half-power widths. If none of these fits converges the first one is returned, as it is.
/// @returns with a line in FitResult::decisions for each mode left out
/// @throws std::invalid_argument: as fit_additive_model()
FitResult settled_fit(const FrfEstimate& frf, const AdditiveModel& start,
                      const FitOptions& options);

}  // namespace stageid
