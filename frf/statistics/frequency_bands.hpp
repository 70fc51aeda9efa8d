#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// Lines of a band that a test or a mean needs at least.
inline constexpr Eigen::Index kFewestLinesOfBand = 8;

/// First line of each band, and the number of lines at the end. Bands are octaves, starting at the first line, joined
/// until each has at least `fewest_lines`. The last band includes the remainder.
/// @pre frequency_hz is not empty and increases
std::vector<Eigen::Index> octave_bands(const Eigen::VectorXd& frequency_hz,
                                       Eigen::Index fewest_lines);

}  // namespace stageid
