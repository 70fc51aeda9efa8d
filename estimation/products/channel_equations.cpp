#include "estimation/products/channel_equations.hpp"

#include <complex>

namespace stageid {

SplitMatrix global_columns(const FitProblem& problem, const FitParameters& beta,
                           const BasisGroup& group, Eigen::Index c, IndexRange lines) {
  const auto on_lines = [lines](const auto& matrix) {
    return matrix.middleRows(lines.first, lines.count);
  };
  SplitMatrix out;
  out.set_zero(lines.count, problem.globals());
  Eigen::Index d = 0;
  for (const auto& [function, parameter] : derivative_columns(problem)) {
    out.re.col(parameter) += beta.B(c, function) * on_lines(group.D.re).col(d);
    out.im.col(parameter) += beta.B(c, function) * on_lines(group.D.im).col(d++);
  }
  if (problem.delay == DelayModel::fixed) return out;
  const Eigen::VectorXd t_re = on_lines(group.T.re) * beta.B.row(c).transpose();
  const Eigen::VectorXd t_im = on_lines(group.T.im) * beta.B.row(c).transpose();
  for (const Eigen::Index t : delay_parameters(problem, c)) {
    out.re.col(t) = t_re;
    out.im.col(t) = t_im;
  }
  return out;
}

EquationMethod::EquationMethod(const FitProblem& of, const FitParameters& beta, FitMethod of_method)
    : problem(of), method(of_method), columns(derivative_columns(of)) {
  if (method == FitMethod::gn) return;
  Y.set_zero(problem.size(), problem.denominators());
  const HoldEquivalent through(problem.lines, 0.0);
  Eigen::Index column = 0;
  SplitMatrix fraction;
  for (const Eigen::VectorXd& a : beta.a) {
    for (const std::complex<double> lambda : roots(a)) {
      through.reciprocal(lambda, fraction);
      for (Eigen::Index q = 1; q <= a.size(); ++q) {
        const std::complex<double> c = equation_error_residue(through, a, lambda, q);
        Y.re.col(column + q - 1) += c.real() * fraction.re - c.imag() * fraction.im;
        Y.im.col(column + q - 1) += c.real() * fraction.im + c.imag() * fraction.re;
      }
    }
    if (!through.exact() && a.size() > 0)
      Y.re.col(column + a.size() - 1).array() += 1.0 / a[a.size() - 1];
    column += a.size();
  }
}

ChannelEquations channel_equations(const EquationMethod& shared, const FitParameters& beta,
                                   const BasisGroup& group, Eigen::Index c) {
  const FitProblem& problem = shared.problem;
  const Eigen::Index N = problem.size();
  const Eigen::Index n_f = problem.functions();
  const Eigen::VectorXd root = problem.weights(c).cwiseSqrt();
  const Eigen::VectorXd E_re =
      problem.G->row(c).real().transpose() - group.F.re * beta.B.row(c).transpose();
  const Eigen::VectorXd E_im =
      problem.G->row(c).imag().transpose() - group.F.im * beta.B.row(c).transpose();
  Eigen::VectorXd E(2 * N);
  E << root.cwiseProduct(E_re), root.cwiseProduct(E_im);

  // Real and imaginary parts stacked, weighted: J of the instrument, Phi of the regressor.
  const SplitMatrix of_globals = global_columns(problem, beta, group, c, {0, N});
  Eigen::MatrixXd whole(2 * N, n_f + problem.globals());
  whole << root.asDiagonal() * group.F.re, root.asDiagonal() * of_globals.re,
      root.asDiagonal() * group.F.im, root.asDiagonal() * of_globals.im;
  std::vector<Eigen::Index> places = indices(0, n_f);  // of the functions and the free globals
  for (Eigen::Index i = 0; i < problem.globals(); ++i)
    if (!problem.is_held(i)) places.push_back(n_f + i);
  const Eigen::MatrixXd J = whole(Eigen::all, places);

  const auto symmetric = [&](const Eigen::MatrixXd& X) -> ChannelEquations {
    Eigen::MatrixXd lower = Eigen::MatrixXd::Zero(X.cols(), X.cols());
    lower.selfadjointView<Eigen::Lower>().rankUpdate(X.transpose());
    return {lower.selfadjointView<Eigen::Lower>(), X.transpose() * E};
  };
  const auto full = [&](const ChannelEquations& of_free) {
    ChannelEquations out{Eigen::MatrixXd::Zero(whole.cols(), whole.cols()),
                         Eigen::VectorXd::Zero(whole.cols())};
    out.M(places, places) = of_free.M;
    out.e(places) = of_free.e;
    return out;
  };
  if (shared.method == FitMethod::gn) return full(symmetric(J));
  Eigen::MatrixXd Phi = J;
  for (Eigen::Index i = 0; n_f + i < Phi.cols(); ++i) {
    const Eigen::Index p = places[static_cast<std::size_t>(n_f + i)] - n_f;
    if (p >= problem.denominators()) break;
    const auto y_re = shared.Y.re.col(p);
    const auto y_im = shared.Y.im.col(p);
    Phi.col(n_f + i).head(N) -= y_re.cwiseProduct(E.head(N)) - y_im.cwiseProduct(E.tail(N));
    Phi.col(n_f + i).tail(N) -= y_re.cwiseProduct(E.tail(N)) + y_im.cwiseProduct(E.head(N));
  }
  if (shared.method == FitMethod::sk) return full(symmetric(Phi));
  return full({J.transpose() * Phi, J.transpose() * E});
}

}  // namespace stageid
