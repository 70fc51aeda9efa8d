#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <deque>
#include <optional>
#include <vector>

#include "estimation/modal/period_spectra.hpp"
#include "estimation/tracking/forgetting_filter.hpp"
#include "estimation/tracking/line_noise.hpp"
#include "estimation/tracking/reference_quality.hpp"
#include "estimation/tracking/tracked_response.hpp"

namespace stageid {

/// The mean of the last periods. @pre 0 < last <= periods.size()
PeriodSpectra mean_of(const std::deque<PeriodSpectra>& periods, std::size_t last);

/// What was learned from periods of a stage without change, at parameters x: the noise, the constant part of the
/// residual, and how the residual depends on x. The parameters are those that fit to the mean of the periods and to what
/// was known before.
///
/// A motion that does not repeat leaves free_motions() on the lines. Those of the free body, and those of the modes that
/// it moved while this was learned, are removed from every residual.
class TrackingReference {
 public:
  /// @param periods at least 4
  /// @param x start of the search for the parameters
  /// @param before estimate and information of other periods
  TrackingReference(const TrackedResponse& response, const std::deque<PeriodSpectra>& periods,
                    Eigen::VectorXd x, const ForgettingFilter& before);

  const Eigen::VectorXd& x() const noexcept { return x_; }
  const Eigen::MatrixXcd& response() const noexcept { return P_; }    ///< at x
  double periods() const noexcept { return periods_; }                ///< learned from
  const Eigen::MatrixXd& information() const noexcept { return A_; }  ///< of a period
  const Eigen::MatrixXd& covariance() const noexcept { return K_; }   ///< of gradient()
  /// Degrees of freedom of the diagonal of covariance(), q.
  const Eigen::VectorXd& freedom() const noexcept { return freedom_; }
  const Eigen::VectorXd& mean_gradient() const noexcept { return gradient_; }
  /// Standard deviation of noise_power() of two periods, by output, over many of them.
  const Eigen::VectorXd& noise_deviation() const noexcept { return noise_deviation_; }
  const ReferenceQuality& quality() const noexcept { return quality_; }

  /// Y - P U without free motions, n_y x N.
  Eigen::MatrixXcd residual(const PeriodSpectra& period, const Eigen::MatrixXcd& P) const;
  Eigen::VectorXd gradient(const Eigen::MatrixXcd& residual) const;  ///< J^T W e
  /// Of the difference of two residuals; 1 on average without change.
  Eigen::VectorXd noise_power(const Eigen::MatrixXcd& difference) const;
  /// Mean square of the free motions that were not there, in a residual at P, relative to that learned.
  double motion_power(const PeriodSpectra& period, const Eigen::MatrixXcd& P) const;
  double motion_freedom() const { return static_cast<double>(other_basis_.cols()); }
  /// Whitened and without free motions: a change of the outputs.
  Eigen::VectorXd whitened_change(const Eigen::MatrixXcd& of) const;
  /// The same of the residual of a mean, minus the constant part.
  Eigen::VectorXd whitened_change(const PeriodSpectra& mean) const;

 private:
  std::vector<Eigen::MatrixXcd> learn_noise(const std::deque<PeriodSpectra>& periods);
  std::vector<Eigen::MatrixXcd> learn_beside(Eigen::MatrixXcd motions,
                                             std::vector<Eigen::MatrixXcd> residuals);
  Eigen::MatrixXcd add_motions(const std::vector<Eigen::MatrixXcd>& residuals);
  void linearize(const Eigen::MatrixXcd& U);
  void settle(const PeriodSpectra& mean, const ForgettingFilter& before);
  void learn_noise_power(const std::vector<Eigen::MatrixXcd>& residuals);
  void judge(const PeriodSpectra& mean);
  Eigen::MatrixXcd raw_residual(const PeriodSpectra& period, const Eigen::MatrixXcd& P) const;
  void remove_motions(Eigen::MatrixXcd& of) const;
  Eigen::MatrixXd beside_motions(const Eigen::MatrixXd& white) const;
  Eigen::VectorXd whitened(const Eigen::MatrixXcd& of) const;

  const TrackedResponse& response_;
  double periods_;
  Eigen::VectorXd x_;
  Eigen::MatrixXcd P_;
  std::vector<Eigen::MatrixXcd> all_motions_;
  Eigen::MatrixXcd motions_;  // that are removed
  std::optional<LineNoise> noise_;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> white_motions_;
  Eigen::MatrixXd motion_basis_;  // orthonormal
  Eigen::MatrixXd other_basis_;   // of the other motions
  double other_power_ = 1.0;
  Eigen::MatrixXd J_;  // whitened derivatives at x, without free motions
  Eigen::MatrixXd A_;
  Eigen::MatrixXd K_;
  Eigen::VectorXd freedom_;
  Eigen::MatrixXcd residual_;  // constant part
  Eigen::VectorXd gradient_;   // of it
  Eigen::VectorXd noise_deviation_;
  ReferenceQuality quality_;
};

}  // namespace stageid
