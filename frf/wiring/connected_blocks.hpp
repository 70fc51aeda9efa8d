#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/wiring/plant_lines.hpp"

namespace stageid {

/// Sensors and actuators that are coupled, directly or through others; indices into G, ascending.
struct ConnectedBlock {
  std::vector<Eigen::Index> outputs;
  std::vector<Eigen::Index> inputs;
  /// Lines of this block alone, each channel scaled by its size, so that units do not matter. Without G0.
  std::vector<PlantLine> lines;
};

/// Splits the plant into parts whose mutual delays cannot be determined.
///
/// Lines are divided by |G|, and rows and columns are scaled to the same power (Sinkhorn's iteration). A pair is
/// coupled if its power is above four times its noise and above a hundredth of that of an average pair. Below a tenth
/// of the amplitude, mode shapes that are not quite real would look like a late channel.
std::vector<ConnectedBlock> connected_blocks(const std::vector<PlantLine>& lines);

}  // namespace stageid
