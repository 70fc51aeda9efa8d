#pragma once

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Minimizes J(beta) = 1/(2N) sum_k vec(E_k)^H W_k vec(E_k), E = G - P, from `start`.
///
/// If the numerators of `start` are zero, only its denominators (and delays) matter: the numerators are then the
/// solution of the convex problem (paper, eq. "convex problem"). Every iteration is damped so that the cost never
/// rises, poles remain stable, and the numerators are re-solved after every denominator step. Weight matrices W_k
/// (likelihood or user) are fitted from that result, see JointEquations.
/// Source: paper, section 3; docs/theory.md, section 8.
/// @throws std::invalid_argument: shapes, weights (variances missing, zero, not finite), more parameters than data,
/// hold without sample rate.
FitResult fit_additive_model(const FrfEstimate& frf, const AdditiveModel& start,
                             const FitOptions& options = {});

/// Replaces submodel k by submodel sources[k], with all its results; a source may be used several times.
void rearrange(const std::vector<std::size_t>& sources, FitResult& fit);

/// Sorts searched modes by frequency, after the other submodels, with their results.
void sort_modes(FitResult& fit);

}  // namespace stageid
