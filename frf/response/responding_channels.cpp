#include "frf/response/responding_channels.hpp"

#include <cmath>
#include <limits>

#include "frf/response/confidence.hpp"

namespace stageid {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

struct RatioSum {
  double sum = 0.0;
  Eigen::Index count = 0;

  double rms() const { return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : kUnknown; }
};

void add_channel(const Eigen::ArrayXXd& error_power, const Eigen::ArrayXXd& power,
                 Eigen::Index channel, RatioSum& ratios) {
  for (Eigen::Index k = 0; k < power.cols(); ++k) {
    if (!(power(channel, k) > 0.0)) continue;
    ratios.sum += error_power(channel, k) / power(channel, k);
    ++ratios.count;
  }
}

}  // namespace

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

Eigen::VectorXd relative_channel_error(const Eigen::ArrayXXd& error_power,
                                       const Eigen::ArrayXXd& power) {
  Eigen::VectorXd out(power.rows());
  for (Eigen::Index c = 0; c < power.rows(); ++c) {
    RatioSum ratios;
    add_channel(error_power, power, c, ratios);
    out[c] = ratios.rms();
  }
  return out;
}

double relative_rms_error(const Eigen::ArrayXXd& error_power, const Eigen::ArrayXXd& power,
                          const ChannelFlags& channels) {
  RatioSum ratios;
  for (Eigen::Index c = 0; c < power.rows(); ++c)
    if (channels[c]) add_channel(error_power, power, c, ratios);
  return ratios.rms();
}

}  // namespace stageid
