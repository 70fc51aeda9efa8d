#pragma once

#include <string>
#include <vector>

#include "frf/wiring/channel_error.hpp"
#include "frf/wiring/plant_lines.hpp"

namespace stageid {

struct SkewCheck {
  std::string unchecked;             ///< the missing data; empty: it was checked
  std::vector<ChannelError> errors;  ///< channels whose timing differs from their kind's
  double largest_deviation_s = 0.0;  ///< largest standard deviation of a skew
};

/// Checks whether all sensors sample, and all actuators act, at the same time (docs/theory.md, section 13).
///
/// With real mode shapes, G e^{j omega tau0} = sum_r R_r d_r(j omega), R_r real, is real away from the resonances. A
/// late channel turns its row or column by -omega tau:
///   Im G_ij = -omega (tau_i + sigma_j) Re G_ij + sum_r (R_r)_ij Im d_r.
/// The sum is the contribution of damping. On all lines of a band, it is in the span of the R_r of the nearby modes,
/// estimated by the lines with the largest Im vec G (pivoted QR). After projection off these, tau and sigma follow by
/// least squares over all lines. Each line is divided by |G|, by its noise if that is above 2 %, and by its residual if
/// that is above the median (a Cauchy weight), because lines close to a resonance outside the span contain no
/// information on skews. The equation is of first order, so the skews are undone and the step is repeated.
///
/// Standard deviations are those of the jackknife over blocks of lines: the residual is not noise but damping of
/// distant modes, which neighbouring lines share. A channel is reported if it is 8 standard deviations and 5 us from
/// the median of its kind. Mode shapes with phases of 2 degrees cause errors of 2 us, with standard deviations of
/// about half of that.
///
/// Sensors and actuators that do not respond to each other (connected_blocks()) are examined separately, each block
/// with its own medians, because their relative delay cannot be determined.
///
/// The common delay of all sensors or all actuators of a block belongs to the plant and cannot be determined.
/// @param outputs, inputs channels of the log for `lines`, see plant_lines().
SkewCheck check_skew(const std::vector<PlantLine>& lines, const std::vector<Eigen::Index>& outputs,
                     const std::vector<Eigen::Index>& inputs);

}  // namespace stageid
