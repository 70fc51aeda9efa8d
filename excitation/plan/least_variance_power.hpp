#pragma once

#include <Eigen/Core>

namespace stageid {

/// How the excitation's power is spread for the least variance, and how near the optimum that is.
struct PowerSpectrum {
  Eigen::VectorXd power;       ///< a, like `cost`
  double cost = 0.0;           ///< sum c_i / a_i
  double lower_bound = 0.0;    ///< no spectrum within the bounds costs less (duality)
  Eigen::VectorXd multiplier;  ///< of each bound, not negative; 0: it does not matter
};

/// Solves   min sum_i c_i / a_i   over a > 0   subject to   B a <= 1.
///
/// With a_i the squared amplitude of one line of one axis, c_i / a_i is its part in the variance of
/// the response and each row of B the mean square of one signal over its limit. The problem is
/// convex; a = sqrt(c / (B^T lambda)) for the multipliers lambda, which grow and shrink by
/// lambda <- lambda (B a) until cost and lower bound, 2 sum sqrt(c B^T lambda) - sum lambda at the
/// best scale, agree to 1e-6 or 3000 rounds are over. What is returned keeps every bound either way.
/// @param cost    c, n, not negative, one positive
/// @param bounds  B, m x n, not negative
/// @throws std::invalid_argument if sizes differ, a number is negative or not finite, or an entry of
///         positive cost is under no bound.
PowerSpectrum least_variance_power(const Eigen::Ref<const Eigen::VectorXd>& cost,
                                   const Eigen::Ref<const Eigen::MatrixXd>& bounds);

}  // namespace stageid
