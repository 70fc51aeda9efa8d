#pragma once

#include "estimation/equations/residue_factors.hpp"
#include "estimation/iteration/fit_iteration.hpp"

namespace stageid {

/// Minimizes the cost over numerators of given ranks (FitOptions::residue_rank and rigid_body_rank), starting from an
/// unconstrained fit `beta`, which is updated with its `factors`. Modes outside the lines represent several modes and
/// remain free.
/// Method: damped Gauss-Newton on denominators, delays and residue factors together. The unconstrained normal matrix
/// is multiplied by the derivatives of the factors from both sides, so an iteration costs as much as an unconstrained
/// one. See docs/theory.md, section 5.
IterationResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                                 ResidueFactors& factors, const FitOptions& options);

}  // namespace stageid
