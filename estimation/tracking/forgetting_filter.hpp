#pragma once

#include <Eigen/Core>

namespace stageid {

/// Least squares with exponential forgetting: the estimate of parameters that change slowly, and its covariance.
///
///   x = argmin sum_n lambda^n |z_n - A_n x|^2 + x^T prior x,
/// the newest period n = 0. What the data do not determine stays near zero, within the prior.
/// Source: L. Ljung, System Identification, 2nd ed. (1999), section 11.2, in information form. Its covariance counts the
/// forgetting: sum lambda^(2n) K_n instead of sum lambda^n A_n.
class ForgettingFilter {
 public:
  /// @param prior information, q x q   @param forgetting lambda, between 0 and 1
  ForgettingFilter(Eigen::MatrixXd prior, double forgetting);

  /// Adds `periods` periods of information A and covariance K of their gradients each. `gradient`: their sum at the
  /// current estimate.
  void add(const Eigen::MatrixXd& A, const Eigen::MatrixXd& K, const Eigen::VectorXd& gradient,
           int periods = 1);
  /// Forgets all but the prior.
  void forget();

  const Eigen::VectorXd& estimate() const noexcept { return x_; }
  Eigen::MatrixXd covariance() const;
  /// Of the data and the prior, around the estimate.
  Eigen::MatrixXd information() const { return information_ + prior_; }

 private:
  Eigen::MatrixXd prior_;
  double forgetting_;
  Eigen::MatrixXd information_;  // sum lambda^n A
  Eigen::MatrixXd scatter_;      // sum lambda^(2n) K
  Eigen::VectorXd x_;
};

}  // namespace stageid
