#pragma once

#include <Eigen/Core>
#include <deque>
#include <vector>

#include "estimation/tracking/change_scores.hpp"
#include "estimation/tracking/stage_change.hpp"
#include "estimation/tracking/tracked_response.hpp"
#include "estimation/tracking/tracking_reference.hpp"

namespace stageid {

/// Least number of periods after the one that contains the transient of a change, for its name.
inline constexpr int kPeriodsToName = 2;

/// Finds the most probable change of the last periods.
class ChangeNaming {
 public:
  /// @param recent the last periods; of a change that needs more of them, the linear effect is sufficient: it is small
  ChangeNaming(const TrackedResponse& response, const TrackingReference& reference,
               const ChangeScores& scores, const std::deque<PeriodSpectra>& recent);

  /// @param since periods after the one that contains the transient of the change, at least kPeriodsToName
  /// @param mean_scores over them, and over one fewer
  StageChange name(int since, const Eigen::VectorXd& mean_scores,
                   const Eigen::VectorXd& mean_scores_of_differences) const;

 private:
  /// The size of a change that explains most, and the chi-square that it explains.
  struct Explanation {
    double explained = 0.0;
    double size = 0.0;
  };
  Explanation explain(const PossibleChange& change, const PeriodSpectra& mean,
                      double linear_size) const;
  std::vector<StageChange> changes_of_response(int since, const Eigen::VectorXd& mean_scores) const;
  std::vector<StageChange> changes_of_noise(int since, const Eigen::VectorXd& mean_scores,
                                            const Eigen::MatrixXcd& P) const;
  StageChange change_of_motion(int since, const Eigen::MatrixXcd& P) const;
  StageChange change_of_scatter(const PossibleChange& what, int since, double ratio,
                                double freedom) const;
  double narrowest(const PossibleChange& change) const;
  double inflation() const;
  double independent(int count) const;
  bool keeps(int since) const { return since <= std::ssize(recent_); }

  const TrackedResponse& response_;
  const TrackingReference& reference_;
  const ChangeScores& scores_;
  const std::deque<PeriodSpectra>& recent_;
};

}  // namespace stageid
