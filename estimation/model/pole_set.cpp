#include "estimation/model/pole_set.hpp"

#include "excitation/decompositions/decompositions.hpp"

namespace stageid {

namespace {
using Complex = std::complex<double>;
}

SplitMatrix partial_fractions(const PoleSet& poles, const Eigen::VectorXcd& x) {
  SplitMatrix phi;
  phi.resize(x.size(), poles.size());
  Eigen::Index column = 0;
  for (const Complex p : poles.pairs) {
    const Eigen::ArrayXcd upper = (x.array() - p).inverse();
    const Eigen::ArrayXcd lower = (x.array() - std::conj(p)).inverse();
    const Eigen::ArrayXcd sum = upper + lower;
    const Eigen::ArrayXcd difference = Complex(0.0, 1.0) * (upper - lower);
    phi.re.col(column) = sum.real();
    phi.im.col(column++) = sum.imag();
    phi.re.col(column) = difference.real();
    phi.im.col(column++) = difference.imag();
  }
  for (const double p : poles.reals) {
    const Eigen::ArrayXcd fraction = (x.array() - Complex(p)).inverse();
    phi.re.col(column) = fraction.real();
    phi.im.col(column++) = fraction.imag();
  }
  return phi;
}

Eigen::VectorXcd zeros_of_sum(const PoleSet& poles, const Eigen::VectorXd& c) {
  const Eigen::Index n = poles.size();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
  Eigen::Index at = 0;
  for (const Complex p : poles.pairs) {
    A.block<2, 2>(at, at) << p.real(), p.imag(), -p.imag(), p.real();
    A.row(at) -= 2.0 * c.transpose();  // b = (2, 0)
    at += 2;
  }
  for (const double p : poles.reals) {
    A(at, at) = p;
    A.row(at++) -= c.transpose();
  }
  return eigenvalues(A);
}

}  // namespace stageid
