#pragma once

#include <Eigen/Core>
#include <deque>

#include "estimation/tracking/change_scores.hpp"
#include "estimation/tracking/stage_change.hpp"
#include "estimation/tracking/tracked_response.hpp"
#include "estimation/tracking/tracking_reference.hpp"

namespace stageid {

/// Least number of periods after the one that contains the transient of a change, for its name.
inline constexpr int kPeriodsToName = 2;

/// Finds the most probable change of the last periods.
/// @param recent the last periods; of a change that needs more of them, the linear effect is sufficient: it is small
/// @param since periods after the one that contains the transient of the change, at least kPeriodsToName
/// @param mean_scores over them, and over one fewer
StageChange name_change(const TrackedResponse& response, const TrackingReference& reference,
                        const ChangeScores& scores, const std::deque<PeriodSpectra>& recent,
                        int since, const Eigen::VectorXd& mean_scores,
                        const Eigen::VectorXd& mean_scores_of_differences);

}  // namespace stageid
