#pragma once

#include <vector>

#include "frf/frf_estimate.hpp"
#include "frf/health_finding.hpp"

namespace stageid {

/// Whether the noise of some experiment is not that of the others (FrfEstimate::experiment_noise_ratio). One finding
/// at most; none where they were pooled.
std::vector<Finding> check_experiment_noise(const FrfEstimate& frf);

}  // namespace stageid
