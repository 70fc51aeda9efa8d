#include "estimation/products/fraction_gram.hpp"

namespace stageid {

using Complex = std::complex<double>;

FractionGram::FractionGram(const PoleSet& poles, const Eigen::VectorXcd& x, bool unit_circle)
    : pairs_(std::ssize(poles.pairs)),
      unit_circle_(unit_circle),
      poles_(poles.size()),
      q_(x.size(), poles.size()),
      over_(poles.size(), poles.size()) {
  Eigen::Index at = 0;
  for (const Complex p : poles.pairs) {
    poles_[at++] = p;
    poles_[at++] = std::conj(p);
  }
  for (const double p : poles.reals) poles_[at++] = p;
  for (Eigen::Index l = 0; l < poles_.size(); ++l) {
    q_.col(l) = (x.array() - poles_[l]).inverse();
    const Eigen::ArrayXcd m = poles_.array().conjugate();
    if (unit_circle)
      over_.col(l) = (1.0 - poles_[l] * m).inverse();
    else
      over_.col(l) = -(poles_[l] + m).inverse();
  }
}

Eigen::MatrixXd FractionGram::operator()(const Eigen::VectorXcd& v) const {
  Eigen::VectorXcd right = q_.transpose() * v;
  Eigen::VectorXcd left = q_.adjoint() * v;
  if (unit_circle_) {
    right = right.cwiseProduct(poles_).array() + v.sum();
    left = left.cwiseProduct(poles_.conjugate());
  }
  Eigen::MatrixXcd Z =
      (left.rowwise().replicate(right.size()) + right.transpose().colwise().replicate(left.size()))
          .cwiseProduct(over_);
  // The columns of a pair are q + p and j (q - p).
  const Complex j(0.0, 1.0);
  for (Eigen::Index i = 0; i < 2 * pairs_; i += 2) {
    const Eigen::VectorXcd upper = Z.col(i);
    Z.col(i) += Z.col(i + 1);
    Z.col(i + 1) = j * (upper - Z.col(i + 1));
  }
  for (Eigen::Index i = 0; i < 2 * pairs_; i += 2) {
    const Eigen::RowVectorXcd upper = Z.row(i);
    Z.row(i) += Z.row(i + 1);
    Z.row(i + 1) = -j * (upper - Z.row(i + 1));
  }
  return Z.real();
}

}  // namespace stageid
