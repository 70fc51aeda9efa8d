#include "frf/statistics/frequency_bands.hpp"

#include <algorithm>

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

Eigen::VectorXd mean_around(const Eigen::MatrixXd& columns, Eigen::Index k, Eigen::Index reach) {
  const Eigen::Index first = std::max<Eigen::Index>(0, k - reach);
  const Eigen::Index end = std::min(columns.cols(), k + reach + 1);
  return columns.middleCols(first, end - first).rowwise().mean();
}

}  // namespace stageid
