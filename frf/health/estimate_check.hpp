#pragma once

#include <string_view>
#include <vector>

#include "frf/periods/estimate_results.hpp"
#include "frf/periods/health_finding.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

inline constexpr std::string_view kUnsettledRemedy =
    "for a transient, discard more periods (--transient-periods); for a drift or slow noise, use "
    "longer periods or --method lpm";

/// Finds bands in which the records are not settled (NonlinearityTest::settled_p_value): the discarded periods do
/// not cover the whole transient, or there is a drift. The variances do not include it, and it would be taken
/// for distortion of the plant. One finding at most, naming the bands; false alarms in at most one of a
/// hundred logs (kUnsettledBelow) for any number of bands.
std::vector<Finding> check_settling(const FrfEstimate& frf);

/// Number of runs whose first used period was discarded, if these are most of them and most of the discarded periods:
/// chance does not choose the first period. Otherwise 0.
int runs_with_discarded_start(const FrfEstimate& frf);

/// Reports that number as a transient.
std::vector<Finding> check_discarded_starts(const FrfEstimate& frf);

/// Withdraws the linearity test if a finding explains why the realizations differ: a drift, a transient, a coarse
/// converter, or a fault of only some of them. All p-values become 1, and settled_p_value 0.
void withdraw_linearity_test(FrfEstimate& frf, const std::vector<Finding>& findings);

/// Finds bands in which the local models of a zippered experiment leave more than noise
/// (FrfEstimate::interpolation_misfit). Possible causes are a resonance too narrow for the distance of an axis's
/// lines, with a bias that the variance does not include, and distortions of the plant, which affect all lines.
/// One finding at most, naming the bands; none for other experiments.
///
/// A line counts if its misfit has a probability below 1e-4 under noise. Without misfit it has the distribution
/// F(2 M a, 2 nu), with a complex degrees of freedom of the local model, nu = noise_dof, M realizations. The
/// outputs are averaged, so the true probability is smaller.
std::vector<Finding> check_interpolation(const FrfEstimate& frf);

/// Checks whether the noise of an experiment differs from that of the others
/// (FrfEstimate::experiment_noise_ratio). At most one finding; none if the experiments were pooled.
/// @param runs the differing runs, if known
/// @param start_known whether the log has StartEvidence; without it, a transient cannot be told from a limit cycle
std::vector<Finding> check_experiment_noise(const FrfEstimate& frf,
                                            const std::vector<NoisyRun>& runs = {},
                                            bool start_known = true);

}  // namespace stageid
