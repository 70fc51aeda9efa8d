#include "frf/periods/bridge.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

using Eigen::Index;

/// Samples on either side from which the line is taken, relative to those that are replaced. More would follow slow noise
/// less, fewer would add their own noise.
constexpr double kEndShare = 0.125;

/// A point of a line: the mean over some samples, in their middle.
struct Point {
  double at = 0.0;
  double value = 0.0;
};

Point mean_point(const Eigen::VectorXf& deviation, Index first, Index count) {
  return {static_cast<double>(first) + 0.5 * static_cast<double>(count - 1),
          deviation.segment(first, count).cast<double>().mean()};
}

}  // namespace

void bridge_samples(std::span<Eigen::MatrixXf> periods, std::span<const std::size_t> reference,
                    std::size_t period, IndexRange gap) {
  Eigen::MatrixXf& own = periods[period];
  const Index count = gap.count();
  const auto most = static_cast<Index>(std::ceil(kEndShare * static_cast<double>(count)));
  const Index before = std::min(most, gap.first);
  const Index after = std::min(most, own.rows() - gap.end);
  const Index begin = gap.first - before;
  Eigen::VectorXf mean(before + count + after);
  for (Index c = 0; c < own.cols(); ++c) {
    mean.setZero();
    for (const std::size_t q : reference) mean += periods[q].col(c).segment(begin, mean.size());
    mean /= static_cast<float>(reference.size());
    const Eigen::VectorXf deviation = own.col(c).segment(begin, mean.size()) - mean;
    const Point left = mean_point(deviation, 0, before);
    const Point right = mean_point(deviation, before + count, after);
    const double slope = (right.value - left.value) / (right.at - left.at);
    for (Index n = before; n < before + count; ++n) {
      const double line = left.value + slope * (static_cast<double>(n) - left.at);
      own(begin + n, c) = mean[n] + static_cast<float>(line);
    }
  }
}

}  // namespace stageid
