#pragma once

#include <vector>

#include "frf/frf_estimate.hpp"
#include "frf/health_finding.hpp"
#include "frf/noisy_run.hpp"

namespace stageid {

/// Whether the noise of some experiment is not that of the others (FrfEstimate::experiment_noise_ratio). One finding
/// at most; none where they were pooled.
/// @param runs which they are, if known
std::vector<Finding> check_experiment_noise(const FrfEstimate& frf,
                                            const std::vector<NoisyRun>& runs = {});

}  // namespace stageid
