#include "estimation/equations/factored_equations.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "estimation/equations/triangles.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/products/equation_method.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

/// Real and imaginary parts of the columns stacked, times `root`.
void stack(const SplitMatrix& columns, const Eigen::VectorXd& root,
           Eigen::Ref<Eigen::MatrixXd> out) {
  out.topRows(root.size()) = root.asDiagonal() * columns.re;
  out.middleRows(root.size(), root.size()) = root.asDiagonal() * columns.im;
}

Eigen::VectorXd stacked_data(const FitProblem& problem, const Eigen::VectorXd& root,
                             Eigen::Index c) {
  Eigen::VectorXd out(2 * root.size());
  out << root.cwiseProduct(problem.G->row(c).real().transpose()),
      root.cwiseProduct(problem.G->row(c).imag().transpose());
  return out;
}

/// Orthogonal factors take as long as sums for sixteen times as many channels.
void add_work(const FitProblem& problem, double channels, Eigen::Index columns) {
  if (problem.limit)
    problem.limit->add(static_cast<double>(problem.size()), 16.0 * channels,
                       static_cast<double>(columns));
}

/// The triangle of one channel for the globals and the data.
Eigen::MatrixXd triangle_of_channel(const FitProblem& problem, const FitParameters& beta,
                                    const BasisGroup& group, Eigen::Index c) {
  const Eigen::Index n_f = problem.functions();
  const Eigen::Index globals = problem.globals();
  const Eigen::VectorXd root = problem.weights(c).cwiseSqrt();
  const Eigen::Index columns = n_f + globals + 1;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(std::max(2 * problem.size(), columns), columns);
  stack(group.F, root, A.leftCols(n_f));
  stack(global_columns(problem, beta, group, c, {0, problem.size()}), root,
        A.middleCols(n_f, globals));
  A.rightCols(1).topRows(2 * problem.size()) = stacked_data(problem, root, c);
  return triangle_after(n_f, A);
}

}  // namespace

FactoredEquations::FactoredEquations(const FitProblem& problem, const FitParameters& beta,
                                     const std::vector<BasisGroup>& groups) {
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, groups);
  const Eigen::Index globals = problem.globals();
  add_work(problem, static_cast<double>(problem.channels()), problem.functions() + globals);
  const Eigen::MatrixXd whole = stacked_triangle(
      problem.channels(), {problem.threads, problem.team},
      [&](Eigen::Index c) { return triangle_of_channel(problem, beta, *group_of[c], c); });
  R_ = whole.topLeftCorner(globals, globals);
  r_ = whole.col(globals).head(globals);
  schur_ = R_.transpose() * R_;
  schur_e_ = R_.transpose() * r_;
}

Eigen::VectorXd FactoredEquations::solve_globals(double damping,
                                                 const std::vector<Eigen::Index>& frozen) const {
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < R_.cols(); ++i)
    if (std::ranges::find(frozen, i) == frozen.end()) free.push_back(i);
  const auto n = std::ssize(free);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(R_.rows() + n, n);
  A.topRows(R_.rows()) = R_(Eigen::all, free);
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  A *= scale.asDiagonal();
  A.bottomRows(n).diagonal().setConstant(std::sqrt(damping));
  Eigen::VectorXd right = Eigen::VectorXd::Zero(A.rows());
  right.head(r_.size()) = r_;
  Eigen::VectorXd step = Eigen::VectorXd::Zero(R_.cols());
  if (n > 0) step(free) = scale.cwiseProduct(least_squares(pivoted_qr(A), right));
  return step;
}

void add_work_of_factors(const FitProblem& problem, double channels) {
  add_work(problem, channels, problem.functions());
}

bool factored_numerators(const FitProblem& problem, const BasisGroup& group, const TileRange& block,
                         Eigen::MatrixXd& B, double& squares) {
  B.setZero(block.members, problem.functions());
  Eigen::VectorXd of_channel = Eigen::VectorXd::Zero(block.members);
  std::atomic<bool> regular = true;
  for_each_task(problem.threads, static_cast<int>(block.members), [&](int member) {
    const Eigen::Index c = group.channels[block.first_member + member];
    const Eigen::VectorXd root = problem.weights(c).cwiseSqrt();
    if (!(root.maxCoeff() > 0.0)) return;
    Eigen::MatrixXd A(2 * problem.size(), problem.functions());
    stack(group.F, root, A);
    Eigen::VectorXd rest = stacked_data(problem, root, c);
    const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300).cwiseInverse();
    A *= scale.asDiagonal();
    const auto factor = qr(A);
    // The part of a column that the others do not contain is rounding.
    const double rounding =
        std::sqrt(static_cast<double>(A.rows())) * std::numeric_limits<double>::epsilon();
    if (!(factor.matrixQR().diagonal().cwiseAbs().minCoeff() > rounding)) {
      regular = false;
      return;
    }
    Eigen::VectorXd x = least_squares(factor, rest);
    rest -= A * x;
    const Eigen::VectorXd refinement = least_squares(factor, rest);
    x += refinement;
    rest -= A * refinement;
    B.row(member) = scale.cwiseProduct(x).transpose();
    of_channel[member] = rest.squaredNorm();
  });
  squares = of_channel.sum();
  return regular;
}

}  // namespace stageid
