#pragma once

#include <Eigen/Core>

#include "estimation/model/pole_set.hpp"

namespace stageid {

/// Weighted products of the columns of partial_fractions(), summed over the lines. With q_l = 1/(x - l)
///   conj(q_m) q_l = -[q_l + conj(q_m)] / (l + m*)               if conj(x) = -x
///                 = [1 + l q_l + conj(m q_m)] / (1 - l m*)      if conj(x) = 1/x
/// so the sums of n columns suffice for n^2 products. The loss of accuracy by cancellation is the ratio of the
/// highest line to the sum of the decay rates of two poles.
class FractionGram {
 public:
  /// @param x j omega, or e^{j omega T} on the unit circle
  FractionGram(const PoleSet& poles, const Eigen::VectorXcd& x, bool unit_circle);

  /// @param v N @returns n x n: sum_k Re{v_k conj(phi_i(k)) phi_j(k)}
  Eigen::MatrixXd operator()(const Eigen::VectorXcd& v) const;

 private:
  Eigen::Index pairs_;
  bool unit_circle_;
  Eigen::VectorXcd poles_;  // upper, lower of every pair; real poles
  Eigen::MatrixXcd q_;      // N x n
  Eigen::MatrixXcd over_;   // n x n: inverse denominators
};

}  // namespace stageid
