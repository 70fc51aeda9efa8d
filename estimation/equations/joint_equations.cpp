#include "estimation/equations/joint_equations.hpp"

#include <utility>

#include "estimation/products/weighted_products.hpp"

namespace stageid {
namespace {

constexpr int kMostIterations = 1000;

Eigen::MatrixXcd residual_tile(const SplitMatrix& E, DataRange lines) {
  Eigen::MatrixXcd X(E.re.rows(), lines.count);
  X.real() = E.re.middleCols(lines.first, lines.count);
  X.imag() = E.im.middleCols(lines.first, lines.count);
  return X;
}

}  // namespace

JointEquations::JointEquations(const FitProblem& problem, const WeightMatrices& weights,
                               const FitParameters& beta, const std::vector<BasisGroup>& groups,
                               const SplitMatrix& E)
    : problem_(problem),
      weights_(weights),
      beta_(beta),
      groups_(groups),
      columns_(derivative_columns(problem)),
      arrow_(problem, beta, groups, FitMethod::gn) {
  if (problem.delays() > 0) {
    T_.resize(problem.channels(), problem.size());
    for (const BasisGroup& group : groups) {
      const Eigen::MatrixXd B = beta.B(group.channels, Eigen::all);
      T_.re(group.channels, Eigen::all) = B * group.T.re.transpose();
      T_.im(group.channels, Eigen::all) = B * group.T.im.transpose();
    }
  }
  e_ = weighted_adjoint([&](DataRange lines) { return residual_tile(E, lines); });
}

Eigen::Index JointEquations::size() const noexcept { return problem_.parameters(); }

/// sum Re{J^H W X}, X given by tiles.
template <typename Columns>
Eigen::VectorXd JointEquations::weighted_adjoint(const Columns& columns) const {
  const auto adjoint = [&](DataRange lines) {
    Eigen::MatrixXcd X = columns(lines);
    weights_.apply(lines.first, X);
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(size());
    add_adjoint(X, lines.first, sum);
    return sum;
  };
  return ordered_sum(ranges_of(problem_.size(), kTileLines), problem_.threads, adjoint);
}

Eigen::VectorXd JointEquations::product(const Eigen::VectorXd& v) const {
  return weighted_adjoint([&](DataRange lines) { return response_change(v, lines); });
}

/// J v on some lines, n_c x lines: dB F^T + B dF^T, and the delays.
Eigen::MatrixXcd JointEquations::response_change(const Eigen::VectorXd& v, DataRange range) const {
  const auto [first, lines] = range;
  const Eigen::Index n_f = problem_.functions();
  const Eigen::MatrixXd dB = v.tail(problem_.channels() * n_f).reshaped(problem_.channels(), n_f);
  Eigen::MatrixXcd change(problem_.channels(), lines);
  for (const BasisGroup& group : groups_) {
    Eigen::MatrixXd coefficients(std::ssize(group.channels), 2 * n_f);
    coefficients << dB(group.channels, Eigen::all), beta_.B(group.channels, Eigen::all);
    Eigen::MatrixXd re = Eigen::MatrixXd::Zero(lines, 2 * n_f);
    Eigen::MatrixXd im = Eigen::MatrixXd::Zero(lines, 2 * n_f);
    re.leftCols(n_f) = group.F.re.middleRows(first, lines);
    im.leftCols(n_f) = group.F.im.middleRows(first, lines);
    for (std::size_t d = 0; d < columns_.size(); ++d) {
      const auto [function, parameter] = columns_[d];
      re.col(n_f + function) += v[parameter] * group.D.re.col(d).segment(first, lines);
      im.col(n_f + function) += v[parameter] * group.D.im.col(d).segment(first, lines);
    }
    Eigen::MatrixXcd part(coefficients.rows(), lines);
    part.real() = coefficients * re.transpose();
    part.imag() = coefficients * im.transpose();
    change(group.channels, Eigen::all) = part;
  }
  if (problem_.delays() == 0) return change;
  for (Eigen::Index c = 0; c < problem_.channels(); ++c) {
    double delay = 0.0;
    for (const Eigen::Index t : delay_parameters(problem_, c)) delay += v[t];
    change.row(c).real() += delay * T_.re.row(c).segment(first, lines);
    change.row(c).imag() += delay * T_.im.row(c).segment(first, lines);
  }
  return change;
}

/// Adds Re{J^H X} of some lines.
void JointEquations::add_adjoint(const Eigen::MatrixXcd& X, Eigen::Index first,
                                 Eigen::VectorXd& sum) const {
  const Eigen::Index n_f = problem_.functions();
  const Eigen::Index lines = X.cols();
  const Eigen::MatrixXd X_re = X.real();
  const Eigen::MatrixXd X_im = X.imag();
  auto e_b = sum.tail(problem_.channels() * n_f).reshaped(problem_.channels(), n_f);
  for (const BasisGroup& group : groups_) {
    const Eigen::MatrixXd re = X_re(group.channels, Eigen::all);
    const Eigen::MatrixXd im = X_im(group.channels, Eigen::all);
    const Eigen::MatrixXd of_group =
        re * group.F.re.middleRows(first, lines) + im * group.F.im.middleRows(first, lines);
    for (std::size_t r = 0; r < group.channels.size(); ++r)
      e_b.row(group.channels[r]) += of_group.row(r);
    const Eigen::MatrixXd B = beta_.B(group.channels, Eigen::all);
    const Eigen::MatrixXd BX_re = re.transpose() * B;
    const Eigen::MatrixXd BX_im = im.transpose() * B;
    for (std::size_t d = 0; d < columns_.size(); ++d) {
      const auto [function, parameter] = columns_[d];
      sum[parameter] += group.D.re.col(d).segment(first, lines).dot(BX_re.col(function)) +
                        group.D.im.col(d).segment(first, lines).dot(BX_im.col(function));
    }
  }
  if (problem_.delays() == 0) return;
  const Eigen::VectorXd TX = T_.re.middleCols(first, lines).cwiseProduct(X_re).rowwise().sum() +
                             T_.im.middleCols(first, lines).cwiseProduct(X_im).rowwise().sum();
  for (Eigen::Index c = 0; c < problem_.channels(); ++c)
    for (const Eigen::Index t : delay_parameters(problem_, c)) sum[t] += TX[c];
}

JointEquations::Solution JointEquations::solve(const Eigen::VectorXd& right_side,
                                               const std::vector<Eigen::Index>& frozen,
                                               double tolerance, double damping) const {
  const Eigen::Index globals = problem_.globals();
  const Eigen::VectorXd damped = damping * arrow_.schur().diagonal().cwiseAbs();
  const auto freeze = [&](Eigen::VectorXd v) {
    for (const Eigen::Index i : frozen) v[i] = 0.0;
    return v;
  };
  Solution solution{Eigen::VectorXd::Zero(size()), freeze(right_side), false};
  Eigen::VectorXd& r = solution.residual;
  Eigen::VectorXd z = arrow_.solve(r, damping, frozen);
  Eigen::VectorXd direction = z;
  double rz = r.dot(z);
  const double wanted = tolerance * tolerance * rz;
  for (int i = 0; rz > wanted && i < kMostIterations; ++i) {
    Eigen::VectorXd q = product(direction);
    q.head(globals) += damped.cwiseProduct(direction.head(globals));
    q = freeze(std::move(q));
    const double curvature = direction.dot(q);
    if (!(curvature > 0.0)) break;  // singular to rounding
    solution.x += rz / curvature * direction;
    r -= rz / curvature * q;
    z = arrow_.solve(r, damping, frozen);
    const double next = r.dot(z);
    direction = z + next / rz * direction;
    rz = next;
  }
  solution.converged = rz <= wanted;
  return solution;
}

double weighted_cost(const FitProblem& problem, const WeightMatrices& weights,
                     const SplitMatrix& E) {
  const auto squares = [&](DataRange lines) {
    const Eigen::MatrixXcd X = residual_tile(E, lines);
    Eigen::MatrixXcd WX = X;
    weights.apply(lines.first, WX);
    return WX.cwiseProduct(X.conjugate()).real().sum();
  };
  const double sum = ordered_sum(ranges_of(problem.size(), kTileLines), problem.threads, squares);
  return sum / (2.0 * static_cast<double>(problem.size()));
}

}  // namespace stageid
