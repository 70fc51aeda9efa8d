#pragma once

#include <string>
#include <vector>

#include "frf/channel_change.hpp"
#include "frf/plant_lines.hpp"

namespace stageid {

struct SkewCheck {
  std::string unchecked;  ///< why nothing can be said; empty: it was checked
  std::vector<ChannelChange>
      changes;  ///< channels that sample or act at another time than their kind
  double largest_deviation_s = 0.0;  ///< standard deviation of the least certain skew
};

/// Do all sensors sample, and all actuators act, at one time?
///
/// With real mode shapes G e^{j omega tau0} = sum_r R_r d_r(j omega), R_r real: away from the resonances it
/// is real. A channel that is late turns its row or column by -omega tau:
///   Im G_ij = -omega (tau_i + sigma_j) Re G_ij + sum_r (R_r)_ij Im d_r.
/// The sum is what damping adds; close to a line it comes from the nearest modes, whose R_r are Im G
/// at their resonances. Projected off these, the equation is least squares for tau and sigma over all
/// lines, each divided by |G| and by its noise where that is above 2 %. Standard deviations by the jackknife over blocks of lines, since what is left
/// is not noise but damping of far modes, which neighbouring lines share. A channel counts if it is 4.5
/// deviations (of 19 degrees of freedom: 2.5e-4 a channel) and 5 us off the median of its kind.
/// @param outputs, inputs channels of the log that `lines` are of, see plant_lines().
SkewCheck check_skew(const std::vector<PlantLine>& lines, const std::vector<Eigen::Index>& outputs,
                     const std::vector<Eigen::Index>& inputs);

}  // namespace stageid
