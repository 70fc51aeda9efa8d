#pragma once

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The last fit of a search that chose the modes itself. If the iteration does not converge, searched modes are
/// removed one by one until it does. First, one of two modes that converged to each other: they overlap, and are
/// closer than the deviation of either frequency. Then the least determined mode: the one with the largest standard
/// deviation, of the damping ratio relative to itself or of the frequency in half-power widths.
/// If none of these fits converges, or only at one and a half times the cost, the first one is returned unchanged.
/// From a fit that converges, undetermined_modes() that are not worth their parameters (BIC) are removed.
/// @returns the fit, with a line in FitResult::decisions per removed mode
/// @throws std::invalid_argument: as fit_additive_model()
FitResult settled_fit(const FrfEstimate& frf, const AdditiveModel& start,
                      const FitOptions& options);

}  // namespace stageid
