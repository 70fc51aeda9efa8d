#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace stageid {

/// What the Hessian of the cost has beside the matrix of Gauss-Newton or refined IV: the second derivatives of the model
/// times the residual. Along parameters that the data hardly determine, such as the damping of a mode far below the lines,
/// this part is the larger one, and steps without it overshoot until they are damped to a crawl. It is learned from
/// the gradients at consecutive points: S changes as little as possible so that (M + S) step = change of the gradient.
/// Dennis, Gay and Welsch, ACM Trans. Math. Software 7 (1981) 348, section 3 (NL2SOL).
class SecantCurvature {
 public:
  /// The equations at a new point: M (its symmetric part counts), and the descent direction e = -gradient.
  /// @param moved from the point before; empty: there is none
  void learn(const Eigen::MatrixXd& M, const Eigen::VectorXd& e, const Eigen::VectorXd& moved);

  /// The step of the last equations with what was learned. None if nothing was, or if M + S is not positive definite.
  std::optional<Eigen::VectorXd> step(const std::vector<Eigen::Index>& frozen) const;

 private:
  Eigen::MatrixXd M_, S_;
  Eigen::VectorXd e_;
  bool learned_ = false;
};

}  // namespace stageid
