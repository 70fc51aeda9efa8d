#include "estimation/products/channel_equations.hpp"

#include <algorithm>

namespace stageid {

void global_columns(const FitProblem& problem, const FitParameters& beta, const BasisGroup& group,
                    Eigen::Index c, const std::vector<DerivativeColumn>& columns, LineRange lines,
                    Eigen::MatrixXd& re, Eigen::MatrixXd& im) {
  const auto on_lines = [lines](const auto& matrix) {
    return matrix.middleRows(lines.first, lines.count);
  };
  re.setZero(lines.count, problem.globals());
  im.setZero(lines.count, problem.globals());
  for (std::size_t d = 0; d < columns.size(); ++d) {
    const auto column = static_cast<Eigen::Index>(d);
    re.col(columns[d].parameter) +=
        beta.B(c, columns[d].function) * on_lines(group.D_re).col(column);
    im.col(columns[d].parameter) +=
        beta.B(c, columns[d].function) * on_lines(group.D_im).col(column);
  }
  if (problem.delay == DelayModel::fixed) return;
  const Eigen::VectorXd t_re = on_lines(group.T_re) * beta.B.row(c).transpose();
  const Eigen::VectorXd t_im = on_lines(group.T_im) * beta.B.row(c).transpose();
  for (const Eigen::Index t : delay_parameters(problem, c)) {
    re.col(t) = t_re;
    im.col(t) = t_im;
  }
}

namespace {

/// The globals that are not held, in their order.
std::vector<Eigen::Index> free_globals(const FitProblem& problem) {
  std::vector<Eigen::Index> out;
  for (Eigen::Index i = 0; i < problem.globals(); ++i)
    if (!problem.is_held(i)) out.push_back(i);
  return out;
}

/// Expands equations of numerators and free globals to all globals, with zeros for the others.
ChannelEquations scattered(const ChannelEquations& of_free, Eigen::Index functions,
                           Eigen::Index globals, const std::vector<Eigen::Index>& free) {
  if (static_cast<Eigen::Index>(free.size()) == globals) return of_free;
  Eigen::Array<Eigen::Index, Eigen::Dynamic, 1> to(of_free.e.size());
  for (Eigen::Index i = 0; i < to.size(); ++i)
    to[i] = i < functions ? i : functions + free[static_cast<std::size_t>(i - functions)];
  ChannelEquations out{Eigen::MatrixXd::Zero(functions + globals, functions + globals),
                       Eigen::VectorXd::Zero(functions + globals)};
  out.M(to, to) = of_free.M;
  out.e(to) = of_free.e;
  return out;
}

}  // namespace

ChannelEquations channel_equations(const FitProblem& problem, const FitParameters& beta,
                                   const BasisGroup& group, Eigen::Index c,
                                   const std::vector<DerivativeColumn>& columns,
                                   const ComplexColumns* Y, FitMethod method) {
  const Eigen::Index N = problem.size();
  const Eigen::Index n_f = problem.functions();
  const Eigen::Index n_a = problem.denominators();
  const Eigen::VectorXd root = problem.weights(c).cwiseSqrt();
  const Eigen::VectorXd E_re =
      problem.G->row(c).real().transpose() - group.F_re * beta.B.row(c).transpose();
  const Eigen::VectorXd E_im =
      problem.G->row(c).imag().transpose() - group.F_im * beta.B.row(c).transpose();
  Eigen::VectorXd E(2 * N);
  E << root.cwiseProduct(E_re), root.cwiseProduct(E_im);

  // Real and imaginary parts stacked, weighted: J of the instrument, Phi of the regressor.
  Eigen::MatrixXd re;
  Eigen::MatrixXd im;
  global_columns(problem, beta, group, c, columns, {0, N}, re, im);
  const std::vector<Eigen::Index> free = free_globals(problem);
  const auto n_free = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd J(2 * N, n_f + n_free);
  J.topLeftCorner(N, n_f) = root.asDiagonal() * group.F_re;
  J.bottomLeftCorner(N, n_f) = root.asDiagonal() * group.F_im;
  for (Eigen::Index i = 0; i < n_free; ++i) {
    J.col(n_f + i).head(N) = root.cwiseProduct(re.col(free[static_cast<std::size_t>(i)]));
    J.col(n_f + i).tail(N) = root.cwiseProduct(im.col(free[static_cast<std::size_t>(i)]));
  }

  const auto symmetric = [&](const Eigen::MatrixXd& X) -> ChannelEquations {
    Eigen::MatrixXd lower = Eigen::MatrixXd::Zero(X.cols(), X.cols());
    lower.selfadjointView<Eigen::Lower>().rankUpdate(X.transpose());
    return {lower.selfadjointView<Eigen::Lower>(), X.transpose() * E};
  };
  const auto full = [&](const ChannelEquations& of_free) {
    return scattered(of_free, n_f, problem.globals(), free);
  };
  if (method == FitMethod::gn) return full(symmetric(J));
  Eigen::MatrixXd Phi = J;
  for (Eigen::Index i = 0; i < n_free; ++i) {
    const Eigen::Index p = free[static_cast<std::size_t>(i)];
    if (p >= n_a) break;
    const auto y_re = Y->re.col(p);
    const auto y_im = Y->im.col(p);
    Phi.col(n_f + i).head(N) -= y_re.cwiseProduct(E.head(N)) - y_im.cwiseProduct(E.tail(N));
    Phi.col(n_f + i).tail(N) -= y_re.cwiseProduct(E.tail(N)) + y_im.cwiseProduct(E.head(N));
  }
  if (method == FitMethod::sk) return full(symmetric(Phi));
  return full({J.transpose() * Phi, J.transpose() * E});
}

}  // namespace stageid
