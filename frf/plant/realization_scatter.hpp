#pragma once

#include <Eigen/Core>

#include "frf/response/line_estimate.hpp"
#include "frf/response/nonlinearity.hpp"

namespace stageid {

/// Mean of degrees of freedom that differ between lines, appropriate for 1 / variance.
double harmonic_mean(const Eigen::VectorXd& dof);

/// Accumulates RealizationScatter over realizations. With q_m = LineNoise::gain, the gain of realization m from the
/// noise C_E to an entry of G (line_estimate.hpp), and w_m = 1 / q_m, W = sum_m w_m,
///   total = sum_m w_m |G^[m] - G_w|^2 / ((M - 1) W),  G_w = sum_m w_m G^[m] / W,
///   noise = C_E / W,  C_E pooled over the realizations by their degrees of freedom.
/// On a linear plant w_m |G^[m] - G|^2 has the variance C_E for every m. The ratio of total and noise therefore has
/// the distribution F(2 (M - 1), 2 nu) for any levels, phases and controllers of the realizations. That of the
/// unweighted mean's variances has it only if all q_m are equal. If the noise of the realizations differs, q_m includes
/// its level, and C_E is divided by it.
/// Source: Cochran's theorem, weighted sums of squares.
class ScatterAverage {
 public:
  ScatterAverage(Eigen::Index outputs, Eigen::Index inputs, Eigen::Index lines);

  /// Adds one realization on line k; its noise has `dof` degrees of freedom and the `level` of its outputs, from many
  /// lines. Lines may be added concurrently.
  void add(const LineEstimate& line, const LineNoise& noise, const Eigen::VectorXd& level,
           double dof, Eigen::Index k);

  /// @pre two realizations were added on every line
  RealizationScatter finish(int realizations) const;

 private:
  Eigen::MatrixXcd mean_;     // (n_y n_u) x N: G_w
  Eigen::MatrixXd scatter_;   // (n_y n_u) x N: sum w |G - G_w|^2
  Eigen::MatrixXd weight_;    // (n_y n_u) x N: W
  Eigen::MatrixXd residual_;  // n_y x N: sum of dof C_E
  Eigen::VectorXd dof_;       // N
};

}  // namespace stageid
