#pragma once

#include <Eigen/Core>

namespace stageid {

/// Distribution of the excitation's power for the least variance, and its distance from the optimum.
struct PowerSpectrum {
  Eigen::VectorXd power;     ///< a, size of `cost`
  double cost = 0.0;         ///< sum c_i / a_i
  double lower_bound = 0.0;  ///< by duality, no spectrum within the bounds has a lower cost
};

/// Solves   min sum_i c_i / a_i   over a > 0   subject to   B a <= 1.
///
/// a_i is the squared amplitude of one line of one axis, c_i / a_i its part in the variance of the
/// response, and each row of B the mean square of one signal over its limit. The problem is convex, with
/// a = sqrt(c / (B^T lambda)). The multipliers are iterated by lambda <- lambda (B a) until the cost and the
/// lower bound agree to 1e-6, or for 3000 iterations. The lower bound is 2 sum sqrt(c B^T lambda) - sum lambda
/// at the best scale. The result satisfies the bounds in either case.
/// @param cost    c, n, not negative, one positive
/// @param bounds  B, m x n, not negative
/// @throws std::invalid_argument if sizes differ, a number is negative or not finite, or an entry of
///         positive cost is unbounded.
PowerSpectrum least_variance_power(const Eigen::Ref<const Eigen::VectorXd>& cost,
                                   const Eigen::Ref<const Eigen::MatrixXd>& bounds);

}  // namespace stageid
