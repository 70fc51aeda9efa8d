#include "estimation/modal/line_correlation.hpp"

#include <algorithm>
#include <cmath>

#include "frf/response/channel_tiles.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kMostLags = 64;
constexpr double kClearlyPositive = 5.0;  // standard deviations of the correlation of white noise

/// Real parts of the autocorrelation over the lines for lags 0, 1, ...; lag 0 is 1.
Eigen::ArrayXd autocorrelation(const FrfEstimate& frf, const ModelBlockResponse& model,
                               const Eigen::MatrixXd& variance, Eigen::Index lags) {
  const auto of_tile = [&](DataRange tile) {
    const Eigen::MatrixXcd white = white_residual(frf, model, variance, tile);
    Eigen::VectorXd part(lags + 1);
    for (Eigen::Index lag = 0; lag <= lags; ++lag) part[lag] = product_at_lag(white, lag).real();
    return part;
  };
  const Eigen::ArrayXd sums = sum_over_tiles(*frf.team, variance.rows(), lags + 1, of_tile);
  return sums / sums[0];
}

}  // namespace

Eigen::MatrixXcd white_residual(const FrfEstimate& frf, const ModelBlockResponse& model,
                                const Eigen::MatrixXd& variance, DataRange channels) {
  const auto [first, count] = channels;
  const Eigen::ArrayXXd of_noise = variance.middleRows(first, count).array();
  const Eigen::ArrayXXcd E =
      frf.response.middleRows(first, count) - model({first, count, 0, frf.lines()});
  return (of_noise > 0.0).select(E / of_noise.sqrt(), std::complex<double>(0.0));
}

std::complex<double> product_at_lag(const Eigen::MatrixXcd& x, Eigen::Index lag) {
  const Eigen::Index n = x.cols() - lag;
  return x.leftCols(n).conjugate().cwiseProduct(x.rightCols(n)).sum();
}

double lines_per_independent(const FrfEstimate& frf, const ModelBlockResponse& model,
                             const Eigen::MatrixXd& variance) {
  if (variance.size() == 0 || frf.lines() < 4) return 1.0;
  // The outputs of one input share disturbances, so they count as one.
  const double limit =
      kClearlyPositive / std::sqrt(2.0 * static_cast<double>(frf.lines() * frf.n_inputs()));
  Eigen::ArrayXd rho = autocorrelation(frf, model, variance, 1);
  if (!(rho[1] > limit)) return 1.0;
  rho = autocorrelation(frf, model, variance, std::min(kMostLags, frf.lines() / 4));
  double out = 1.0;
  for (Eigen::Index lag = 1; lag < rho.size() && rho[lag] > limit; ++lag) out += 2.0 * rho[lag];
  return out;
}

}  // namespace stageid
