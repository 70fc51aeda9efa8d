#pragma once

#include <string_view>
#include <vector>

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

/// Withdraws the linearity test if a finding explains why the realizations differ: a drift, a transient, or a fault of
/// only some of them. All p-values become 1, and settled_p_value 0.
void withdraw_linearity_test(FrfEstimate& frf, const std::vector<Finding>& findings);

}  // namespace stageid
