#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/model/pole_set.hpp"

namespace stageid {

/// Weighted products of the columns of partial_fractions(), summed over the lines. With q_l = 1/(x - l)
///   conj(q_m) q_l = -[q_l + conj(q_m)] / (l + m*)               where conj(x) = -x
///                 = [1 + l q_l + conj(m q_m)] / (1 - l m*)      where conj(x) = 1/x
/// so that the sums of n columns are enough for n^2 products. What is lost by cancelling is the highest line
/// over the sum of two poles' decay rates.
class FractionGram {
 public:
  /// @param x j omega, or e^{j omega T} on the unit circle
  FractionGram(const PoleSet& poles, const Eigen::VectorXcd& x, bool unit_circle);

  /// @param v N @returns n x n: sum_k Re{v_k conj(phi_i(k)) phi_j(k)}
  Eigen::MatrixXd operator()(const Eigen::VectorXcd& v) const;

 private:
  Eigen::Index pairs_;
  bool unit_circle_;
  Eigen::VectorXcd poles_;  // upper, lower of every pair; reals
  Eigen::MatrixXcd q_;      // N x n
  Eigen::MatrixXcd over_;   // n x n: the denominators' inverses
};

}  // namespace stageid
