#pragma once

#include <string>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Which request fits the data better, one sentence. That is decided by trial, in this order:
///   channels whose response is noise on most lines     -> leave them out
///   one refit of the model with each other structure    -> the one of least BIC, if it beats the model itself
///   one end of the band holds most of what is left over -> the band without it
///   else the number of modes is to be named
/// @param cut_short the search did not come to its end: that more modes would fit better is no advice then
std::string advice_for(const FrfEstimate& frf, const FitOptions& options, const FitResult& fit,
                       bool cut_short);

/// What a search that used its budget says: how far it came, and advice_for() its completed model.
std::string budget_message(const FrfEstimate& frf, const FitOptions& options, const FitResult& fit);

/// Makes the completed model of a search that reached options.limit say so: a last fit that has converged is not the
/// end of a search.
void tell_limit(const FrfEstimate& frf, const FitOptions& options, FitResult& fit);

}  // namespace stageid
