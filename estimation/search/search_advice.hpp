#pragma once

#include "estimation/fit/fit_verdict.hpp"
#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Adds to a reason the request that would fit the data better. Determined by trial, in this order:
///   channels whose response is noise on most lines        -> exclude them
///   the complex conjugate fits better                     -> a warning
///   one refit of the model per alternative structure, and one with the modes that the residual shows
///                                                         -> the one of least BIC, if better than the model itself
///   otherwise                                             -> look at the data
/// @param number how the number of modes was determined; if by a search, more modes are not advised
/// @param cut_short the search ended early: then neither
FitReason with_advice(FitReason reason, const FrfEstimate& frf, const FitOptions& options,
                      const FitResult& fit, ModeNumber number, bool cut_short);

/// Why a search that reached options.limit is not to be trusted: its progress, and advice for its completed model.
FitReason limit_reason(const FrfEstimate& frf, const FitOptions& options, const FitResult& fit);

}  // namespace stageid
