#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Where the local models of a zippered experiment leave more than noise explains
/// (FrfEstimate::interpolation_misfit): a resonance too narrow for the distance of an axis' own lines,
/// where the response has a bias that its variance does not hold, or distortions of the plant, which
/// fall on all lines. One finding at most, naming the bands; none for other experiments.
///
/// A line counts if noise alone leaves so much on one of ten thousand: the misfit has the distribution
/// F(2 M a, 2 nu) then, a complex degrees of freedom of the local model, nu = noise_dof, M realizations.
/// The outputs' shares are averaged, which makes the test stricter than stated.
std::vector<Finding> check_interpolation(const FrfEstimate& frf);

}  // namespace stageid
