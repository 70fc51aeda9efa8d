#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/periods/noisy_run.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Whether the noise of some experiment is not that of the others (FrfEstimate::experiment_noise_ratio). One finding
/// at most; none where they were pooled.
/// @param runs which they are, if known
std::vector<Finding> check_experiment_noise(const FrfEstimate& frf,
                                            const std::vector<NoisyRun>& runs = {});

}  // namespace stageid
