#include "estimation/correlated_outputs.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

constexpr Eigen::Index kTileEntries = 1 << 17;  // of the columns of all outputs

}  // namespace

OutputCorrelation::OutputCorrelation(const FrfEstimate& frf) : n_y_(frf.n_outputs()) {
  if (frf.residual_covariance_re.size() == 0) return;
  re_ = &frf.residual_covariance_re;
  im_ = &frf.residual_covariance_im;
}

void OutputCorrelation::between(Eigen::Index y, Eigen::Index z, LineRange lines, Eigen::ArrayXd& re,
                                Eigen::ArrayXd& im) const {
  re.resize(lines.count);
  im.resize(lines.count);
  const Eigen::Index at = y + n_y_ * z;
  for (Eigen::Index i = 0; i < lines.count; ++i) {
    const Eigen::Index k = lines.first + i;
    const double power = (*re_)(y * (n_y_ + 1), k) * (*re_)(z * (n_y_ + 1), k);
    const double root = std::sqrt(power);
    re[i] = power > 0.0 ? (*re_)(at, k) / root : 0.0;
    im[i] = power > 0.0 ? (*im_)(at, k) / root : 0.0;
  }
}

OutputColumns correlated(const OutputCorrelation& correlation, const OutputColumns& X,
                         LineRange lines) {
  const auto n_y = static_cast<Eigen::Index>(X.re.size());
  OutputColumns Y = X;  // the diagonal of R is one
  Eigen::ArrayXd re;
  Eigen::ArrayXd im;
  for (Eigen::Index y = 0; y < n_y; ++y)
    for (Eigen::Index z = 0; z < n_y; ++z) {
      if (z == y) continue;
      const auto to = static_cast<std::size_t>(y);
      const auto from = static_cast<std::size_t>(z);
      correlation.between(y, z, lines, re, im);
      Y.re[to].array() += X.re[from].array().colwise() * re - X.im[from].array().colwise() * im;
      Y.im[to].array() += X.re[from].array().colwise() * im + X.im[from].array().colwise() * re;
    }
  return Y;
}

Eigen::MatrixXd correlated_gram(
    const FitProblem& problem, const OutputCorrelation& correlation, Eigen::Index n,
    const ColumnsOfOutput& columns,
    const std::function<void(LineRange lines, const OutputColumns& Y)>& use) {
  const auto n_y = static_cast<std::size_t>(problem.n_outputs);
  const Eigen::Index N = problem.size();
  const Eigen::Index most =
      std::max<Eigen::Index>(1, kTileEntries / std::max<Eigen::Index>(1, n * problem.n_outputs));
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n, n);
  OutputColumns X{std::vector<Eigen::MatrixXd>(n_y), std::vector<Eigen::MatrixXd>(n_y)};
  for (Eigen::Index first = 0; first < N; first += most) {
    const LineRange lines{first, std::min(most, N - first)};
    for (std::size_t y = 0; y < n_y; ++y)
      columns(static_cast<Eigen::Index>(y), lines, X.re[y], X.im[y]);
    const OutputColumns Y = correlated(correlation, X, lines);
    for (std::size_t y = 0; y < n_y; ++y) {
      K.noalias() += X.re[y].transpose() * Y.re[y];
      K.noalias() += X.im[y].transpose() * Y.im[y];
    }
    if (use) use(lines, Y);
  }
  return 0.5 * (K + K.transpose());
}

}  // namespace stageid
