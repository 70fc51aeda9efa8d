#pragma once

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Minimizes J(beta) = 1/(2N) sum_k vec(E_k)^H W_k vec(E_k), E = G - P, from `start`.
///
/// Only the denominators (and delays) of `start` matter when its numerators are zero: they are then
/// the solution of the convex problem (paper, eq. "convex problem"). Every iteration is damped so
/// that the cost never rises, poles stay stable, and the numerators are re-solved after every
/// denominator step. Weight matrices W_k (likelihood, or a user's) are fitted from there, see
/// JointEquations. Source: paper, section 3; method.md section 6.
/// @throws std::invalid_argument: shapes, weights (variances missing, zero, not finite), more
///         parameters than data, hold without sample rate.
FitResult fit_additive_model(const FrfEstimate& frf, const AdditiveModel& start,
                             const FitOptions& options = {});

/// Submodel sources[k] in place k, with all that is told of it; one may stand in several places.
void rearrange(const std::vector<std::size_t>& sources, FitResult& fit);

/// Searched modes by frequency, behind the other submodels, with what is known of each.
void sort_modes(FitResult& fit);

}  // namespace stageid
