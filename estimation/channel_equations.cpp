#include "estimation/channel_equations.hpp"

namespace stageid {

void global_columns(const FitProblem& problem, const FitParameters& beta, const BasisGroup& group,
                    Eigen::Index c, const std::vector<DerivativeColumn>& columns,
                    Eigen::MatrixXd& re, Eigen::MatrixXd& im) {
  re.setZero(problem.size(), problem.globals());
  im.setZero(problem.size(), problem.globals());
  for (std::size_t d = 0; d < columns.size(); ++d) {
    const auto column = static_cast<Eigen::Index>(d);
    re.col(columns[d].parameter) += beta.B(c, columns[d].function) * group.D_re.col(column);
    im.col(columns[d].parameter) += beta.B(c, columns[d].function) * group.D_im.col(column);
  }
  if (problem.delay == DelayModel::fixed) return;
  const Eigen::VectorXd t_re = group.T_re * beta.B.row(c).transpose();
  const Eigen::VectorXd t_im = group.T_im * beta.B.row(c).transpose();
  for (const Eigen::Index t : delay_parameters(problem, c)) {
    re.col(t) = t_re;
    im.col(t) = t_im;
  }
}

ChannelEquations channel_equations(const FitProblem& problem, const FitParameters& beta,
                                   const BasisGroup& group, Eigen::Index c,
                                   const std::vector<DerivativeColumn>& columns,
                                   const ComplexColumns* Y, FitMethod method) {
  const Eigen::Index N = problem.size();
  const Eigen::Index n_f = problem.functions();
  const Eigen::Index n_a = problem.denominators();
  const Eigen::VectorXd root = problem.W.row(c).transpose().cwiseSqrt();
  const Eigen::VectorXd E_re =
      problem.G_re.row(c).transpose() - group.F_re * beta.B.row(c).transpose();
  const Eigen::VectorXd E_im =
      problem.G_im.row(c).transpose() - group.F_im * beta.B.row(c).transpose();
  Eigen::VectorXd E(2 * N);
  E << root.cwiseProduct(E_re), root.cwiseProduct(E_im);

  // Real and imaginary parts below each other, weighted: J of the instrument, Phi of the regressor.
  Eigen::MatrixXd re;
  Eigen::MatrixXd im;
  global_columns(problem, beta, group, c, columns, re, im);
  Eigen::MatrixXd J(2 * N, n_f + problem.globals());
  J.topLeftCorner(N, n_f) = root.asDiagonal() * group.F_re;
  J.bottomLeftCorner(N, n_f) = root.asDiagonal() * group.F_im;
  J.topRightCorner(N, problem.globals()) = root.asDiagonal() * re;
  J.bottomRightCorner(N, problem.globals()) = root.asDiagonal() * im;

  ChannelEquations out;
  const auto symmetric = [&](const Eigen::MatrixXd& X) {
    Eigen::MatrixXd lower = Eigen::MatrixXd::Zero(X.cols(), X.cols());
    lower.selfadjointView<Eigen::Lower>().rankUpdate(X.transpose());
    out.M = lower.selfadjointView<Eigen::Lower>();
    out.e = X.transpose() * E;
  };
  if (method == FitMethod::gn) {
    symmetric(J);
    return out;
  }
  Eigen::MatrixXd Phi = J;
  for (Eigen::Index p = 0; p < n_a; ++p) {
    const auto y_re = Y->re.col(p);
    const auto y_im = Y->im.col(p);
    Phi.col(n_f + p).head(N) -= y_re.cwiseProduct(E.head(N)) - y_im.cwiseProduct(E.tail(N));
    Phi.col(n_f + p).tail(N) -= y_re.cwiseProduct(E.tail(N)) + y_im.cwiseProduct(E.head(N));
  }
  if (method == FitMethod::sk) {
    symmetric(Phi);
    return out;
  }
  out.M = J.transpose() * Phi;
  out.e = J.transpose() * E;
  return out;
}

}  // namespace stageid
