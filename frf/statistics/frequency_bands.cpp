#include "frf/statistics/frequency_bands.hpp"

namespace stageid {

std::vector<IndexRange> octave_bands(const Eigen::VectorXd& frequency_hz,
                                     Eigen::Index fewest_lines) {
  const Eigen::Index N = frequency_hz.size();
  std::vector<IndexRange> bands = {{0, N}};
  for (Eigen::Index k = 1; k < N; ++k) {
    const Eigen::Index first = bands.back().first;
    if (frequency_hz[k] < 2.0 * frequency_hz[first] || k - first < fewest_lines) continue;
    bands.back().end = k;
    bands.push_back({k, N});
  }
  if (bands.size() > 1 && bands.back().count() < fewest_lines) bands.pop_back();
  bands.back().end = N;
  return bands;
}

}  // namespace stageid
