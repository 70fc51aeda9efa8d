#include "estimation/products/equation_method.hpp"

#include <complex>

namespace stageid {

SplitMatrix global_columns(const FitProblem& problem, const FitParameters& beta,
                           const BasisGroup& group, Eigen::Index c, DataRange lines) {
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

}  // namespace stageid
