#include "estimation/iteration/secant_curvature.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimation/equations/arrow_system.hpp"

namespace stageid {

void SecantCurvature::learn(const Eigen::MatrixXd& M, const Eigen::VectorXd& e,
                            const Eigen::VectorXd& moved) {
  M_ = 0.5 * (M + M.transpose());
  const Eigen::VectorXd before = e_;
  e_ = e;
  if (moved.size() == 0 || before.size() != e.size()) return;
  if (S_.size() == 0) S_ = Eigen::MatrixXd::Zero(M.rows(), M.cols());
  const Eigen::VectorXd change = before - e;
  const double curvature = change.dot(moved);
  if (!(curvature > 0.0)) return;
  const Eigen::VectorXd lacking = change - M_ * moved;
  // Sizing: S was learned elsewhere and may be too large here.
  const double old = std::abs(moved.dot(S_ * moved));
  if (old > 0.0) S_ *= std::min(1.0, std::abs(moved.dot(lacking)) / old);
  const Eigen::VectorXd rest = lacking - S_ * moved;
  const Eigen::MatrixXd both = rest * change.transpose() / curvature;
  S_ += both + both.transpose() -
        rest.dot(moved) / (curvature * curvature) * change * change.transpose();
  learned_ = S_.allFinite();
}

std::optional<Eigen::VectorXd> SecantCurvature::step(
    const std::vector<Eigen::Index>& frozen) const {
  if (!learned_) return std::nullopt;
  const Eigen::MatrixXd H = M_ + S_;
  const Eigen::VectorXd scale = H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd scaled = scale.asDiagonal() * H * scale.asDiagonal();
  Eigen::VectorXd right = scale.cwiseProduct(e_);
  hold_unknowns(frozen, scaled);
  for (const Eigen::Index i : frozen) right[i] = 0.0;
  const Eigen::LLT<Eigen::MatrixXd> factors(scaled);
  if (factors.info() != Eigen::Success) return std::nullopt;
  return scale.cwiseProduct(factors.solve(right));
}

}  // namespace stageid
