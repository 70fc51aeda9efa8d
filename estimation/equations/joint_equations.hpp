#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/problem/residual.hpp"
#include "estimation/problem/weight_matrices.hpp"

namespace stageid {

/// The Gauss-Newton equations of all parameters at once under Hermitian weights,
///   M x = e,   M = sum Re{J^H W_k J},   e = sum Re{J^H W_k vec E},
/// in the order of ArrowSystem: globals, then vec B.
///
/// W_k couples the channels, so M is not an arrow. It is never formed: J, W_k and J^H are applied one after another on
/// tiles of lines, at the cost of a few residuals. The equations are solved by conjugate gradients, preconditioned by
/// the arrow of the diagonal weights FitProblem::W. Tiles are fixed and added in order, so the result does not depend
/// on the number of threads.
class JointEquations {
 public:
  /// @pre `groups` were evaluated with derivatives at `beta`, `E` is their residual, and problem.W is
  /// weights.marginal(). All of them must outlive the equations.
  JointEquations(const FitProblem& problem, const WeightMatrices& weights,
                 const FitParameters& beta, const std::vector<BasisGroup>& groups,
                 const SplitMatrix& E);

  Eigen::Index size() const noexcept;
  const Eigen::VectorXd& gradient() const noexcept { return e_; }  ///< e
  const ArrowSystem& preconditioner() const noexcept { return arrow_; }
  bool regular() const noexcept { return arrow_.regular(); }

  /// M v.
  Eigen::VectorXd product(const Eigen::VectorXd& v) const;

  struct Solution {
    Eigen::VectorXd x;
    Eigen::VectorXd residual;  ///< right_side minus M x, on the free parameters
    bool converged = false;
  };
  /// (M + damping D)^-1 right_side on the free parameters, D the diagonal of the Schur complement of the arrow;
  /// `frozen` globals remain zero.
  /// @param tolerance on the error of x relative to x, in the norm of the arrow
  Solution solve(const Eigen::VectorXd& right_side, const std::vector<Eigen::Index>& frozen,
                 double tolerance, double damping = 0.0) const;

 private:
  template <typename Columns>
  Eigen::VectorXd weighted_adjoint(const Columns& columns) const;
  Eigen::MatrixXcd response_change(const Eigen::VectorXd& v, DataRange range) const;
  void add_adjoint(const Eigen::MatrixXcd& X, Eigen::Index first, Eigen::VectorXd& sum) const;

  const FitProblem& problem_;
  const WeightMatrices& weights_;
  const FitParameters& beta_;
  const std::vector<BasisGroup>& groups_;
  std::vector<DerivativeColumn> columns_;
  SplitMatrix T_;  // n_c x N: dP/d delay; empty if the delays are fixed
  ArrowSystem arrow_;
  Eigen::VectorXd e_;
};

/// 1/(2N) sum vec(E)^H W_k vec(E).
double weighted_cost(const FitProblem& problem, const WeightMatrices& weights,
                     const SplitMatrix& E);

}  // namespace stageid
