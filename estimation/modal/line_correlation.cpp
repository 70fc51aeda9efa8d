#include "estimation/modal/line_correlation.hpp"

#include <cmath>
#include <limits>

namespace stageid {
namespace {

constexpr Eigen::Index kMostLags = 64;
constexpr double kClearlyPositive = 5.0;  // standard deviations of the correlation of white noise

}  // namespace

double lines_per_independent(const FrfEstimate& frf, const ModelBlockResponse& model,
                             const Eigen::MatrixXd& variance) {
  const Eigen::Index lags = std::min<Eigen::Index>(kMostLags, frf.lines() / 4);
  if (variance.size() == 0 || lags == 0) return 1.0;
  Eigen::ArrayXd sums = Eigen::ArrayXd::Zero(lags + 1);
  for (Eigen::Index c = 0; c < frf.response.rows(); ++c) {
    const Eigen::ArrayXd deviation =
        variance.row(c).transpose().array().sqrt().max(std::numeric_limits<double>::min());
    const Eigen::VectorXcd white =
        (frf.response.row(c) - model({c, 1, 0, frf.lines()})).transpose().array() / deviation;
    if (!white.allFinite()) continue;
    for (Eigen::Index lag = 0; lag <= lags; ++lag) {
      const Eigen::Index n = white.size() - lag;
      sums[lag] += white.head(n).dot(white.tail(n)).real();
    }
  }
  // The outputs of one input share disturbances, so they count as one.
  const double limit =
      kClearlyPositive / std::sqrt(2.0 * static_cast<double>(frf.lines() * frf.n_inputs()));
  double out = 1.0;
  for (Eigen::Index lag = 1; lag <= lags && sums[lag] > limit * sums[0]; ++lag)
    out += 2.0 * sums[lag] / sums[0];
  return out;
}

}  // namespace stageid
