#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// Covariance of weighted sums over the lines, as estimated from few periods.
struct SumCovariance {
  Eigen::MatrixXd value;    ///< q x q
  Eigen::VectorXd freedom;  ///< degrees of freedom of each variance
};

/// The noise of the outputs on every line, learned from the scatter of a stage's residuals over periods without change.
/// A line through the periods is removed first: a stage may drift while it is learned.
///
/// The scatter of few periods is regularized by that of the neighbouring lines, with as many degrees of freedom as
/// outputs. Each neighbour is scaled to the power of the line's own noise, by the trace of the whitened scatter. In a
/// loop, the noise of the forces moves the sensors together, differently from line to line; unscaled, it would hide the
/// directions in which the noise of a line is small. The covariance of weighted sums over lines is computed by leaving
/// out one period after the other: weights from the same period would lower it.
class LineNoise {
 public:
  /// @param residuals of at least 4 periods, n_y x N each
  explicit LineNoise(const std::vector<Eigen::MatrixXcd>& residuals);

  /// Real rows with variance one on average, 2 n_y N, of residuals or derivatives whose columns are vec(n_y x N).
  Eigen::MatrixXd whitened(const Eigen::Ref<const Eigen::MatrixXcd>& columns) const;
  /// Covariance of J^T e over the periods. @param J whitened derivatives, e a whitened residual
  SumCovariance covariance(const Eigen::MatrixXd& J) const;
  /// Mean over the lines of |difference|^2 / (2 variance) of two periods, by output: 1 on average for later periods
  /// without change. The variance is that of the line itself: narrow resonances of the noise count as one line each.
  Eigen::VectorXd relative_power(const Eigen::MatrixXcd& difference) const;

 private:
  /// Of the covariance of real and imaginary parts.
  Eigen::MatrixXcd inverse_factor(const Eigen::MatrixXcd& scatter, Eigen::Index k,
                                  double freedom) const;
  Eigen::MatrixXcd scatter_around(Eigen::Index k) const;

  Eigen::Index n_y_;

  std::vector<Eigen::MatrixXcd> neighbours_;      // scatter_around() each line
  std::vector<Eigen::MatrixXcd> inverse_factor_;  // L^-1 of each line, L L^H = C / 2
  std::vector<Eigen::MatrixXcd> deviations_;  // n_y x periods by line, each of the noise's variance
  std::vector<Eigen::MatrixXcd> scatter_;     // sum of the squares of the residuals, by line
  Eigen::MatrixXd variance_;                  // n_y x N
};

}  // namespace stageid
