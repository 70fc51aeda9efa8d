#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace stageid {

/// Neighbouring samples of a period, from `first` to before `end`.
struct SampleRange {
  Eigen::Index first = 0;
  Eigen::Index end = 0;

  Eigen::Index count() const noexcept { return end - first; }
  bool empty() const noexcept { return first == end; }
  /// Extends the range to contain the other as well.
  void include(const SampleRange& other) {
    if (other.empty()) return;
    first = empty() ? other.first : std::min(first, other.first);
    end = std::max(end, other.end);
  }
};

}  // namespace stageid
