#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace stageid {

/// Neighbouring samples or lines, from `first` to before `end`.
struct IndexRange {
  Eigen::Index first = 0;
  Eigen::Index end = 0;

  Eigen::Index count() const noexcept { return end - first; }
  bool empty() const noexcept { return first == end; }
  /// Extends the range to contain the other as well.
  void include(const IndexRange& other) {
    if (other.empty()) return;
    first = empty() ? other.first : std::min(first, other.first);
    end = std::max(end, other.end);
  }
};

}  // namespace stageid
