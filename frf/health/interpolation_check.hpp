#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Finds bands in which the local models of a zippered experiment leave more than noise
/// (FrfEstimate::interpolation_misfit). Possible causes are a resonance too narrow for the distance of an axis's
/// lines, with a bias that the variance does not include, and distortions of the plant, which affect all lines.
/// One finding at most, naming the bands; none for other experiments.
///
/// A line counts if its misfit has a probability below 1e-4 under noise. Without misfit it has the distribution
/// F(2 M a, 2 nu), with a complex degrees of freedom of the local model, nu = noise_dof, M realizations. The
/// outputs are averaged, so the true probability is smaller.
std::vector<Finding> check_interpolation(const FrfEstimate& frf);

}  // namespace stageid
