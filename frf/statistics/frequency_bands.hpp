#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// First line of each band, and the number of lines at the end. Bands are octaves from the first
/// line on, joined until each has at least `fewest_lines`; what is left over belongs to the last.
/// @pre frequency_hz is not empty and increases
std::vector<Eigen::Index> octave_bands(const Eigen::VectorXd& frequency_hz,
                                       Eigen::Index fewest_lines);

}  // namespace stageid
