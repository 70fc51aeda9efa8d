#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

using ChannelFlags = Eigen::Array<bool, Eigen::Dynamic, 1>;

/// Channels (n_y n_u) whose response has a meaningful relative error: |G|^2 exceeds the 95 % point of noise on at
/// least half of the lines. The relative error of other channels is that of their noise. For data without variances:
/// channels that are not all zero. Of FrfEstimate::own(); the others are false.
ChannelFlags responding_channels(const FrfEstimate& frf);

/// The sum of |E|^2 / |G|^2 over the lines with nonzero G, and the number of these lines; one row per channel.
/// @param error_power, power |E|^2 and |G|^2, channels x lines
Eigen::ArrayX2d relative_squares(const Eigen::ArrayXXd& error_power, const Eigen::ArrayXXd& power);

/// sqrt(mean |E|^2 / |G|^2) over all of these lines of the flagged channels; NaN if there are none.
double relative_rms_error(const Eigen::Ref<const Eigen::ArrayX2d>& squares,
                          const ChannelFlags& channels);

}  // namespace stageid
