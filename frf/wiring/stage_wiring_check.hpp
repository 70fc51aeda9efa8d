#pragma once

#include <string>
#include <vector>

#include "frf/wiring/channel_error.hpp"
#include "frf/wiring/plant_lines.hpp"

namespace stageid {

/// Deviation above which the rigid body itself differs from the configuration.
inline constexpr double kLargestRigidDeviation = 0.3;

struct StageWiringCheck {
  std::string unchecked;                     ///< the missing data; empty: it was checked
  std::vector<ChannelError> errors;          ///< gains and exchanges, not undone in the record
  std::vector<Eigen::Index> dead_actuators;  ///< excited but without any effect
  double deviation = 0.0;  ///< remaining rms over the entries, relative to the rms of their row
  double band_hz[2] = {0.0, 0.0};
};

/// Compares the plant's rigid body with the configured geometry and mass. If they differ, searches for wrongly wired
/// channels that explain it.
///
/// Below the first flexible mode, for sensor i and actuator j,
///   -omega^2 G_ij = A_ij + D_ij omega^2 + D'_ij omega^4,
/// real apart from the delay: A is the rigid body, D the compliance of the flexible modes. The same fit to the nominal
/// rigid body gives A0. A term in 1 / omega^2, for another suspension than the configured one, is added if it brings A
/// closer to A0. A wiring gain g of a channel scales its row or column; an exchange of channels exchanges them.
/// The variance of A is that of the scatter of the lines where it exceeds the noise: a nonlinear plant distorts the
/// lines in all periods alike.
/// The error that brings A closest to A0 is accepted if it does so in the lower and in the upper half of the lines
/// too, and the search is repeated: a channel's gain is the same on all lines, a suspension that stiffens with the
/// motion is not. Positive gains after which the body still differs by more than kLargestRigidDeviation are no
/// explanation and are discarded. Entries have a tolerance of 10 % of the rms of their row, the accuracy of
/// amplifiers, masses and positions. A gain is accepted from 30 % on, or if it
/// is negative.
/// The band ends at 0.7 of the frequency at which omega^2 |G| exceeds its median by half.
///
/// @param outputs, inputs channels of the log for `lines`, see plant_lines().
StageWiringCheck check_stage_wiring(const std::vector<PlantLine>& lines,
                                    const std::vector<Eigen::Index>& outputs,
                                    const std::vector<Eigen::Index>& inputs);

}  // namespace stageid
