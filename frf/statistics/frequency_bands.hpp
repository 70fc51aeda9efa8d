#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// Lines of a band that a test or a mean needs at least.
inline constexpr Eigen::Index kFewestLinesOfBand = 8;

/// Neighbouring lines, from `first` to before `end`.
struct LineBand {
  Eigen::Index first = 0;
  Eigen::Index end = 0;
  Eigen::Index count() const noexcept { return end - first; }
};

/// Octaves, starting at the first line, joined until each has at least `fewest_lines`. The last band includes the
/// remainder.
/// @pre frequency_hz is not empty and increases
std::vector<LineBand> octave_bands(const Eigen::VectorXd& frequency_hz,
                                   Eigen::Index fewest_lines = kFewestLinesOfBand);

}  // namespace stageid
