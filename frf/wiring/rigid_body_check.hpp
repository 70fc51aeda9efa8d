#pragma once

#include <string>
#include <vector>

#include "frf/wiring/channel_change.hpp"
#include "frf/wiring/plant_lines.hpp"

namespace stageid {

struct RigidBodyCheck {
  std::string unchecked;                     ///< why nothing can be said; empty: it was checked
  std::vector<ChannelChange> changes;        ///< gains and exchanges, not undone in the record
  std::vector<Eigen::Index> dead_actuators;  ///< excited and without any effect
  double deviation = 0.0;  ///< what is left: rms over the entries, of the rms of their row
  double band_hz[2] = {0.0, 0.0};
};

/// Is the plant's rigid body that of the configuration's geometry and mass? If not, which wrongly wired
/// channels explain it?
///
/// Below the first flexible mode, for sensor i and actuator j,
///   -omega^2 G_ij = A_ij + D_ij omega^2 + D'_ij omega^4,
/// real but for the delay: A is the rigid body, D the compliance of the flexible modes. The same fit to
/// the nominal rigid body gives A0. A channel that is wired with a gain g scales its row or column,
/// one that is exchanged with another exchanges them: of all of these the change that brings A
/// nearest to A0 is taken, then the next one. Entries are held to 10 % of the rms of their row: amplifiers,
/// masses and positions are known no better; a gain counts from 30 % on, or if it is negative.
/// The band ends at 0.7 of the frequency where omega^2 |G| has grown by half over its median.
///
/// @param outputs, inputs channels of the log that `lines` are of, see plant_lines().
RigidBodyCheck check_rigid_body(const std::vector<PlantLine>& lines,
                                const std::vector<Eigen::Index>& outputs,
                                const std::vector<Eigen::Index>& inputs);

}  // namespace stageid
