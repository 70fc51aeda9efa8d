#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/wiring/plant_lines.hpp"

namespace stageid {

/// Sensors and actuators that see each other, directly or through others; positions in G, ascending.
struct ConnectedBlock {
  std::vector<Eigen::Index> outputs;
  std::vector<Eigen::Index> inputs;
  /// Lines of this block alone, each channel over its own size: units do not matter. Without G0.
  std::vector<PlantLine> lines;
};

/// Splits the plant where a delay of one side against the other could not be told.
///
/// Lines are divided by |G|, rows and columns scaled to the same power (Sinkhorn's iteration). A pair
/// connects if its power is above four times its noise, and a hundredth of that of an average pair: below a
/// tenth of the amplitude, mode shapes that are not quite real turn it as a late channel would.
std::vector<ConnectedBlock> connected_blocks(const std::vector<PlantLine>& lines);

}  // namespace stageid
