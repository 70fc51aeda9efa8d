#pragma once

#include <string>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A request that would fit the data better, one sentence. Determined by trial, in this order:
///   channels whose response is noise on most lines        -> exclude them
///   one refit of the model per alternative structure      -> the one of least BIC, if better than the model itself
///   one end of the band has most of the residual          -> the band without it
///   otherwise                                             -> request a number of modes
/// @param cut_short the search ended early: then more modes are not advised
std::string advice_for(const FrfEstimate& frf, const FitOptions& options, const FitResult& fit,
                       bool cut_short);

/// Message of a search that reached options.limit: its progress, and advice_for() its completed model.
std::string limit_message(const FrfEstimate& frf, const FitOptions& options, const FitResult& fit);

}  // namespace stageid
