#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimation/model/pole_set.hpp"
#include "excitation/threads/team.hpp"

namespace stageid {

/// The equations of a pole relocation (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14 (1999) 1052): in every
/// channel, H sigma is a sum of fractions with the same poles, sigma = phi c + d. The numerators of the channels are
/// eliminated (Deschrijver et al., IEEE MWCL 18 (2008) 383).
class SigmaEquations {
 public:
  /// @param x N: j omega, or e^{j omega T} on the unit circle
  /// @param G n_c x N, H times a factor on every line  @param weights n_c x N, of |G - P|^2; must outlive this
  /// @param own N x any: functions of the numerators besides the fractions
  SigmaEquations(Eigen::VectorXcd x, bool unit_circle, const Eigen::MatrixXcd& G,
                 const Eigen::VectorXcd& factor, const Eigen::MatrixXd& weights, SplitMatrix own,
                 const Workers& workers);

  /// R, n+1 x n+1: |R (c, d)|^2 is the squared residual of the equations. The norm of its last column is that of the
  /// residual with numerators alone. The result does not depend on the workers.
  /// @param accurate to rounding; else to about half of the digits, in a tenth of the time
  Eigen::MatrixXd triangle(const PoleSet& poles, bool accurate) const;

  const Eigen::VectorXcd& x() const noexcept { return x_; }
  /// N, rising from 0 to 1 (to 0.5 for a constant response): half of it with the change of log H, half with the lines.
  /// Where it rises steeply, the data need many poles and tell much about them.
  const Eigen::VectorXd& path() const noexcept { return path_; }

 private:
  std::vector<Eigen::Index> representative(Eigen::Index count) const;
  Eigen::MatrixXd by_factors(const SplitMatrix& phi) const;
  std::optional<Eigen::MatrixXd> by_sums(const PoleSet& poles, const SplitMatrix& phi) const;

  Eigen::VectorXcd x_;
  bool unit_circle_;
  Eigen::MatrixXcd H_;
  Eigen::VectorXd path_;
  Eigen::VectorXd power_;  // |factor|^2
  const Eigen::MatrixXd& weights_;
  SplitMatrix own_;
  Workers workers_;
};

}  // namespace stageid
