#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace stageid {

/// The value that would stand at `rank`, from 0, if the values were sorted. Reorders them.
/// @pre rank < values.size()
inline double value_of_rank(std::span<double> values, std::size_t rank) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The value that `share` of the values lie below: 0.25 the lower quartile, 0.5 the (upper) median.
/// Reorders them. @pre not empty, 0 <= share < 1
inline double order_statistic(std::span<double> values, double share) {
  return value_of_rank(values,
                       static_cast<std::size_t>(share * static_cast<double>(values.size())));
}

/// The mean of the two values in the middle, or the one that stands there. Reorders them. @pre not empty
inline double median(std::span<double> values) {
  const double lower = value_of_rank(values, (values.size() - 1) / 2);
  return 0.5 * (lower + value_of_rank(values, values.size() / 2));
}

}  // namespace stageid
