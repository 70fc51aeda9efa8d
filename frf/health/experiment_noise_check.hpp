#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/periods/noisy_run.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Checks whether the noise of an experiment differs from that of the others
/// (FrfEstimate::experiment_noise_ratio). At most one finding; none if the experiments were pooled.
/// @param runs the differing runs, if known
std::vector<Finding> check_experiment_noise(const FrfEstimate& frf,
                                            const std::vector<NoisyRun>& runs = {});

}  // namespace stageid
