#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace stageid {

/// The value at index `rank`, from 0, of the sorted values. Reorders them.
/// @pre rank < values.size()
inline double value_of_rank(std::span<double> values, std::size_t rank) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The value with the share `share` of the values below it: 0.25 the lower quartile, 0.5 the (upper) median.
/// Reorders them. @pre not empty, 0 <= share < 1
inline double order_statistic(std::span<double> values, double share) {
  return value_of_rank(values,
                       static_cast<std::size_t>(share * static_cast<double>(values.size())));
}

/// The median; for an even count, the mean of the two middle values. Reorders them. @pre not empty
inline double median(std::span<double> values) {
  const double lower = value_of_rank(values, (values.size() - 1) / 2);
  return 0.5 * (lower + value_of_rank(values, values.size() / 2));
}

}  // namespace stageid
