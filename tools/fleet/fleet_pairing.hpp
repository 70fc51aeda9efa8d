#pragma once

#include "tools/fleet/fleet_store.hpp"

namespace stageid {

/// Follows the modes of each stage over time (mode.track), those stages over which identifications were added only,
/// and then recognizes the same modes on different stages (track.mode, counted from 1 by frequency). Also marks outliers
/// with their reason. A mode that is seen in less than 20 % of a stage's identifications has no number. The result does not depend on the order in which identifications were added.
/// @throws as FleetStore
void pair_fleet(FleetStore& store);

}  // namespace stageid
