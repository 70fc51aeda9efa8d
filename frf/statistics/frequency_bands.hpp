#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/statistics/index_range.hpp"

namespace stageid {

/// Lines of a band that a test or a mean needs at least.
inline constexpr Eigen::Index kFewestLinesOfBand = 8;

/// Octaves, starting at the first line, joined until each has at least `fewest_lines`. The last band includes the
/// remainder.
/// @pre frequency_hz is not empty and increases
std::vector<IndexRange> octave_bands(const Eigen::VectorXd& frequency_hz,
                                     Eigen::Index fewest_lines = kFewestLinesOfBand);

/// Mean over column k and up to `reach` columns on each side, fewer at the ends.
Eigen::VectorXd mean_around(const Eigen::MatrixXd& columns, Eigen::Index k, Eigen::Index reach);

}  // namespace stageid
