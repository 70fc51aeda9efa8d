#pragma once

#include <string_view>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

inline constexpr std::string_view kUnsettledRemedy =
    "for a transient, discard more periods (--transient-periods); for a drift or slow noise, use "
    "longer periods or --method lpm";

/// Where the records are not settled (NonlinearityTest::settled_p_value): a transient that is left after
/// the periods passed over, or a drift. It adds to the response what no variance holds, and would pass
/// for distortions of the plant. One finding at most, naming the bands; by chance in one of a hundred logs
/// (kUnsettledBelow) at most, however many bands there are.
std::vector<Finding> check_settling(const FrfEstimate& frf);

}  // namespace stageid
