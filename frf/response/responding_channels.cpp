#include "frf/response/responding_channels.hpp"

#include <cmath>

#include "frf/response/confidence.hpp"

namespace stageid {

ChannelFlags responding_channels(const FrfEstimate& frf) {
  const auto [first, count] = frf.own();
  ChannelFlags flags = ChannelFlags::Constant(frf.response.rows(), false);
  // not evaluated, to save memory
  const auto power = frf.response.middleRows(first, count).cwiseAbs2().array();
  const bool noise = frf.noise_variance.size() > 0;
  const Eigen::MatrixXd& variance = noise ? frf.noise_variance : frf.total_variance;
  if (variance.size() == 0) {
    flags.segment(first, count) = (power > 0.0).rowwise().any();
    return flags;
  }
  const double limit = squared_error_quantile(0.95, noise ? frf.noise_dof : frf.total_dof);
  const auto above = power > limit * variance.middleRows(first, count).array();
  flags.segment(first, count) = 2 * above.rowwise().count() >= power.cols();
  return flags;
}

Eigen::ArrayX2d relative_squares(const Eigen::ArrayXXd& error_power, const Eigen::ArrayXXd& power) {
  Eigen::ArrayX2d squares(power.rows(), 2);
  squares.col(0) = (power > 0.0).select(error_power / power, 0.0).rowwise().sum();
  squares.col(1) = (power > 0.0).cast<double>().rowwise().sum();
  return squares;
}

double relative_rms_error(const Eigen::Ref<const Eigen::ArrayX2d>& squares,
                          const ChannelFlags& channels) {
  const Eigen::Array2d sums =
      (squares.colwise() * channels.cast<double>()).colwise().sum().transpose();
  return std::sqrt(sums[0] / sums[1]);  // 0 / 0: NaN
}

}  // namespace stageid
