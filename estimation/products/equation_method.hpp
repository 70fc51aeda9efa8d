#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/products/weighted_products.hpp"

namespace stageid {

/// Columns d vec(P)_c / d globals for one channel, lines x globals.
SplitMatrix global_columns(const FitProblem& problem, const FitParameters& beta,
                           const BasisGroup& group, Eigen::Index c, DataRange lines);

/// What the equations of all channels have in common.
struct EquationMethod {
  EquationMethod(const FitProblem& of, const FitParameters& beta, FitMethod method);

  const FitProblem& problem;
  FitMethod method;
  std::vector<DerivativeColumn> columns;
  /// d log A_i / d a_q on every line, one column per denominator coefficient, N x n_a: s^q / A_i. With exact hold, A_i
  /// is the product of z - e^{lambda T} over its roots, and Y is the same in z. Empty for gn.
  SplitMatrix Y;
};

}  // namespace stageid
