#include "estimation/tracking/line_noise.hpp"

#include <algorithm>

#include "excitation/decompositions/decompositions.hpp"
#include "excitation/words/require.hpp"

namespace stageid {

namespace {

/// Passes of the scaling, which converges to 1 % even if the neighbours have a thousand times the noise in a direction.
constexpr int kPasses = 10;

Eigen::MatrixXcd inverse_root(Eigen::MatrixXcd C) {
  C.diagonal().array() += 1e-12 * C.diagonal().real().maxCoeff() + 1e-300;  // noise-free outputs
  return inverse_cholesky(C);
}

}  // namespace

Eigen::MatrixXcd LineNoise::inverse_factor(const Eigen::MatrixXcd& scatter, Eigen::Index k,
                                           double freedom) const {
  return inverse_root(0.5 * (scatter + neighbours_[k]) / (freedom + static_cast<double>(n_y_)));
}

/// The scatter around a line, of n_y degrees of freedom, each neighbour scaled to the power of the line's own noise.
Eigen::MatrixXcd LineNoise::scatter_around(Eigen::Index k) const {
  const auto N = std::ssize(scatter_);
  const auto freedom = static_cast<double>(deviations_.front().cols() - 2);
  const auto n_y = static_cast<double>(n_y_);
  const Eigen::Index first = std::max<Eigen::Index>(0, k - n_y_);
  const Eigen::Index last = std::min(N - 1, k + n_y_);
  if (first == last) return Eigen::MatrixXcd::Zero(n_y_, n_y_);
  const double share = n_y / (freedom * static_cast<double>(last - first));
  const auto sum_of = [&](const auto& weight) {
    Eigen::MatrixXcd sum = Eigen::MatrixXcd::Zero(n_y_, n_y_);
    for (Eigen::Index l = first; l <= last; ++l) {
      const Eigen::MatrixXcd& other = scatter_[l];
      if (l != k) sum += weight(other) * other;
    }
    return sum;
  };
  Eigen::MatrixXcd around = sum_of([&](const Eigen::MatrixXcd&) { return share; });
  for (int pass = 0; pass < kPasses; ++pass) {
    const Eigen::MatrixXcd root = inverse_root((scatter_[k] + around) / (freedom + n_y));
    around = sum_of([&](const Eigen::MatrixXcd& other) {
      const double power = (root * other * root.adjoint()).trace().real();
      return share * n_y * freedom / std::max(power, 1e-300);
    });
  }
  return around;
}

LineNoise::LineNoise(const std::vector<Eigen::MatrixXcd>& residuals) {
  const auto periods = std::ssize(residuals);
  require(periods >= 4, "LineNoise: fewer than 4 periods");
  n_y_ = residuals.front().rows();
  const Eigen::Index N = residuals.front().cols();
  variance_.resize(n_y_, N);
  const auto freedom = static_cast<double>(periods - 2);  // beside mean and slope
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(periods, -1.0, 1.0);
  const Eigen::ArrayXd leverage =
      1.0 / static_cast<double>(periods) + time.array().square() / time.squaredNorm();
  for (Eigen::Index k = 0; k < N; ++k) {
    Eigen::MatrixXcd deviation(n_y_, periods);
    for (Eigen::Index t = 0; t < periods; ++t) deviation.col(t) = residuals[t].col(k);
    const Eigen::VectorXcd mean = deviation.rowwise().mean();
    deviation.colwise() -= mean;
    const Eigen::VectorXcd slope = deviation * time / time.squaredNorm();
    deviation -= slope * time.transpose();
    // The mean inverse of a chi-square of nu complex degrees of freedom is 1 / (nu - 1).
    variance_.col(k) = deviation.rowwise().squaredNorm() / (freedom - 1.0);
    scatter_.emplace_back(deviation * deviation.adjoint());
    deviations_.emplace_back(deviation * (1.0 - leverage).rsqrt().matrix().asDiagonal());
  }
  for (Eigen::Index k = 0; k < N; ++k) {
    neighbours_.push_back(scatter_around(k));
    inverse_factor_.push_back(inverse_factor(scatter_[k], k, freedom));
  }
}

Eigen::MatrixXd LineNoise::whitened(const Eigen::Ref<const Eigen::MatrixXcd>& columns) const {
  const auto N = std::ssize(inverse_factor_);
  Eigen::MatrixXd out(2 * n_y_ * N, columns.cols());
  for (Eigen::Index k = 0; k < N; ++k) {
    const Eigen::MatrixXcd white = inverse_factor_[k] * columns.middleRows(k * n_y_, n_y_);
    out.middleRows(2 * k * n_y_, n_y_) = white.real();
    out.middleRows((2 * k + 1) * n_y_, n_y_) = white.imag();
  }
  return out;
}

SumCovariance LineNoise::covariance(const Eigen::MatrixXd& J) const {
  const Eigen::Index periods = deviations_.front().cols();
  const auto n = static_cast<double>(periods);
  SumCovariance K{Eigen::MatrixXd::Zero(J.cols(), J.cols()), Eigen::VectorXd::Zero(J.cols())};
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(J.cols());
  Eigen::MatrixXd white(2 * n_y_, periods);
  for (std::size_t k = 0; k < deviations_.size(); ++k) {
    // J is whitened by all periods: L^H W d, W of the others, gives J^T of the residual under their weights.
    const Eigen::MatrixXcd L_adjoint = inverse(inverse_factor_[k].adjoint());
    for (Eigen::Index t = 0; t < periods; ++t) {
      // The scatter of the others is that of all without d d^H.
      const Eigen::VectorXcd d = deviations_[k].col(t);
      const Eigen::MatrixXcd others = inverse_factor(scatter_[k] - d * d.adjoint(), k, n - 3.0);
      const Eigen::VectorXcd w = L_adjoint * (others.adjoint() * (others * d));
      white.col(t) << w.real(), w.imag();
    }
    const Eigen::MatrixXd sums = J.middleRows(2 * k * n_y_, 2 * n_y_).transpose() * white;
    K.value.noalias() += sums * sums.transpose() / n;
    squares += (sums.rowwise().squaredNorm().array() / n).square();
  }
  // A variance kappa_k of n periods has n - 2 degrees of freedom; of their sum, see Satterthwaite (1946). `squares`
  // includes the scatter of kappa_k^2, a factor n / (n - 2).
  K.freedom = n * K.value.diagonal().array().square() / squares.max(1e-300);
  return K;
}

Eigen::VectorXd LineNoise::relative_power(const Eigen::MatrixXcd& difference) const {
  return (0.5 * difference.cwiseAbs2().array() / variance_.array().max(1e-300)).rowwise().mean();
}

}  // namespace stageid
