#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

using ChannelFlags = Eigen::Array<bool, Eigen::Dynamic, 1>;

/// Which channels (n_y n_u) have a response of which a relative error means anything: |G|^2 is above the 95 %
/// point of noise alone on at least half of the lines. The relative error of any other is that of its noise.
/// Of data without variances: those that are not zero throughout.
ChannelFlags responding_channels(const FrfEstimate& frf);

/// sqrt(mean |E|^2 / |G|^2) over the lines of every channel where G is not zero, n_y n_u; NaN if there is none.
/// @param error_power, power |E|^2 and |G|^2, (n_y n_u) x N
Eigen::VectorXd relative_channel_error(const Eigen::ArrayXXd& error_power,
                                       const Eigen::ArrayXXd& power);

/// The same over the lines of all channels flagged.
double relative_rms_error(const Eigen::ArrayXXd& error_power, const Eigen::ArrayXXd& power,
                          const ChannelFlags& channels);

}  // namespace stageid
