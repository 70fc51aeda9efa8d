#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace stageid {

/// Detects the change of one of several properties at an unknown time, by generalized likelihood ratios.
///
/// Every period gives one score per hypothesis, normal without change, independent over periods, correlated between
/// hypotheses. A change of hypothesis h since w periods shifts its scores; twice the log likelihood ratio is
///   nu ln(1 + t^2 / nu),   t^2 = (sum of w scores)^2 / (w (1 + w/n)),
/// n the periods of the reference, whose mean was subtracted from the scores, and nu the degrees of freedom of the
/// variance to which they were scaled. The largest over all h and over w = 1, 2, 4, ... is compared with a threshold.
/// The threshold follows from the rate of false alarms: simulated scores with the same correlation give the rate at
/// their median maximum, and the tail c sqrt(t) e^{-t/2} continues it to rarer alarms.
/// Source: M. Basseville and I. V. Nikiforov, Detection of Abrupt Changes (1993), sections 2.4.3 and 7.2.4.
class ChangeDetector {
 public:
  /// @param correlation of the scores, H x H   @param freedom of their variances, H, at least 2
  /// @throws std::invalid_argument if a value is not finite
  /// @param false_alarms_per_period above 0, at most 0.1
  ChangeDetector(const Eigen::MatrixXd& correlation, Eigen::VectorXd freedom,
                 double false_alarms_per_period, int reference_periods);

  /// @returns the number of periods since a change, by maximum likelihood, if the threshold is exceeded; else 0
  int add(const Eigen::VectorXd& scores);
  /// Of all hypotheses, over the last periods. @pre not more than were added, nor than 512
  Eigen::VectorXd mean_scores(int periods) const { return sum_of(periods) / periods; }
  /// Forgets all periods, not what was learned.
  void restart();
  double threshold() const noexcept { return threshold_; }
  /// The largest statistic of the last period, and that of its hypothesis.
  double largest() const noexcept { return largest_; }
  /// The largest statistic of the last period, by hypothesis.
  const Eigen::ArrayXd& largest_by_hypothesis() const noexcept { return by_hypothesis_; }

 private:
  Eigen::ArrayXd statistics(std::int64_t periods) const;
  Eigen::ArrayXd sum_of(std::int64_t periods) const;
  void calibrate(const Eigen::MatrixXd& correlation, double false_alarms_per_period);
  Eigen::Index scan();

  Eigen::ArrayXd freedom_;
  double reference_periods_;
  double threshold_ = 0.0;
  double largest_ = 0.0;
  Eigen::ArrayXd by_hypothesis_;
  int window_ = 1;  // of the largest statistic
  std::int64_t count_ = 0;
  Eigen::ArrayXXd sums_;  // H x ring: of all scores before a period
};

}  // namespace stageid
