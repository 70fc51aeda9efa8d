#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/tracking/stage_change.hpp"
#include "estimation/tracking/tracking_reference.hpp"

namespace stageid {

/// The evidence of a period for every possible change, as scores with mean zero and variance one without change.
class ChangeScores {
 public:
  ChangeScores(std::vector<PossibleChange> possible, const TrackingReference& reference);

  /// @param gradient of the period, without the mean   @param noise_power by sensor; empty: unknown
  Eigen::VectorXd of(const Eigen::VectorXd& gradient, const Eigen::VectorXd& noise_power) const;
  Eigen::MatrixXd correlation() const;
  /// Degrees of freedom of the variances by which the scores are scaled.
  Eigen::VectorXd freedom() const;
  const std::vector<PossibleChange>& possible() const noexcept { return possible_; }

 private:
  std::vector<PossibleChange> possible_;
  const TrackingReference& reference_;
};

}  // namespace stageid
