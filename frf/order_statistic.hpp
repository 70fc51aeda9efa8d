#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace stageid {

/// The value that `share` of the values lie below: 0.25 the lower quartile, 0.5 the (upper) median.
/// Reorders them. @pre not empty, 0 <= share < 1
inline double order_statistic(std::span<double> values, double share) {
  const auto rank = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size()));
  const auto at = values.begin() + rank;
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace stageid
