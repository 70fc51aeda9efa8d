#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

using ChannelFlags = Eigen::Array<bool, Eigen::Dynamic, 1>;

/// Channels (n_y n_u) whose response has a meaningful relative error: |G|^2 exceeds the 95 % point of noise on at
/// least half of the lines. The relative error of other channels is that of their noise. For data without variances:
/// channels that are not all zero. Of FrfEstimate::own(); the others are false.
ChannelFlags responding_channels(const FrfEstimate& frf);

/// sqrt(mean |E|^2 / |G|^2) over the lines with nonzero G, per channel, n_y n_u; NaN if there is none.
/// @param error_power, power |E|^2 and |G|^2, (n_y n_u) x N
Eigen::VectorXd relative_channel_error(const Eigen::ArrayXXd& error_power,
                                       const Eigen::ArrayXXd& power);

/// The same over the lines of all flagged channels.
double relative_rms_error(const Eigen::ArrayXXd& error_power, const Eigen::ArrayXXd& power,
                          const ChannelFlags& channels);

}  // namespace stageid
