#include "estimation/correlated_outputs.hpp"

#include <cmath>

namespace stageid {

Eigen::MatrixXcd output_correlation(const FrfEstimate& frf) {
  if (frf.residual_covariance_re.size() == 0) return {};
  const Eigen::Index n_y = frf.n_outputs();
  Eigen::MatrixXcd out(n_y * n_y, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    for (Eigen::Index i = 0; i < n_y; ++i)
      for (Eigen::Index l = 0; l < n_y; ++l) {
        const double power = frf.residual_covariance_re(i * (n_y + 1), k) *
                             frf.residual_covariance_re(l * (n_y + 1), k);
        const Eigen::Index at = i + n_y * l;
        if (i == l)
          out(at, k) = 1.0;
        else
          out(at, k) = power > 0.0 ? std::complex<double>(frf.residual_covariance_re(at, k),
                                                          frf.residual_covariance_im(at, k)) /
                                         std::sqrt(power)
                                   : 0.0;
      }
  return out;
}

OutputColumns correlated(const Eigen::MatrixXcd& correlation, const OutputColumns& X) {
  const auto n_y = static_cast<Eigen::Index>(X.re.size());
  OutputColumns Y = X;  // the diagonal of R is one
  for (Eigen::Index y = 0; y < n_y; ++y)
    for (Eigen::Index z = 0; z < n_y; ++z) {
      if (z == y) continue;
      const auto to = static_cast<std::size_t>(y);
      const auto from = static_cast<std::size_t>(z);
      const Eigen::ArrayXd re = correlation.row(y + n_y * z).real().transpose();
      const Eigen::ArrayXd im = correlation.row(y + n_y * z).imag().transpose();
      Y.re[to].array() += X.re[from].array().colwise() * re - X.im[from].array().colwise() * im;
      Y.im[to].array() += X.re[from].array().colwise() * im + X.im[from].array().colwise() * re;
    }
  return Y;
}

Eigen::MatrixXd correlated_gram(const OutputColumns& X, const OutputColumns& Y) {
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(X.re[0].cols(), Y.re[0].cols());
  for (std::size_t y = 0; y < X.re.size(); ++y) {
    K.noalias() += X.re[y].transpose() * Y.re[y];
    K.noalias() += X.im[y].transpose() * Y.im[y];
  }
  return 0.5 * (K + K.transpose());
}

}  // namespace stageid
