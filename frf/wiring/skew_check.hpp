#pragma once

#include <string>
#include <vector>

#include "frf/wiring/channel_change.hpp"
#include "frf/wiring/plant_lines.hpp"

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
/// The sum is what damping adds: on all lines of a band it lies in the span of the R_r of the modes near
/// it, found as the lines of the largest Im vec G (pivoted QR). Projected off these, the equation is
/// least squares for tau and sigma over all lines, each divided by |G| and by its noise where that is above
/// 2 %, and by what the equation leaves of it where that is above the median (a Cauchy weight): close to a
/// resonance that the span does not hold, the equation says nothing of skews. The skews are undone and the
/// step repeated, since the equation is their first order. Standard deviations by the
/// jackknife over blocks of lines, since what is left is not noise but damping of far modes, which
/// neighbouring lines share. A channel counts if it is 8 deviations and 5 us off the median of its kind: mode
/// shapes that are not quite real, with phases of 2 degrees, make errors of 2 us whose deviations come out
/// at half of that.
///
/// Sensors and actuators that do not respond to each other (connected_blocks()) are looked at apart: how their
/// delays differ, nothing tells, and each block has medians of its own.
///
/// What all sensors, or all actuators, of a block share is the plant's delay and cannot be seen.
/// @param outputs, inputs channels of the log that `lines` are of, see plant_lines().
SkewCheck check_skew(const std::vector<PlantLine>& lines, const std::vector<Eigen::Index>& outputs,
                     const std::vector<Eigen::Index>& inputs);

}  // namespace stageid
