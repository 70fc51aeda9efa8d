#include "frf/periods/bridge.hpp"

#include <algorithm>

namespace stageid {
namespace {

using Eigen::Index;

constexpr Index kGapPerEnd =
    8;  // samples of the gap per sample from which an end of the line is taken

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
                    std::size_t period, Index first, Index count) {
  Eigen::MatrixXf& own = periods[period];
  const Index end = first + count;
  const Index most = (count + kGapPerEnd - 1) / kGapPerEnd;
  const Index before = std::min(most, first);
  const Index after = std::min(most, own.rows() - end);
  Eigen::VectorXf mean(own.rows());
  for (Index c = 0; c < own.cols(); ++c) {
    mean.setZero();
    for (const std::size_t q : reference) mean += periods[q].col(c);
    mean /= static_cast<float>(reference.size());
    const Eigen::VectorXf deviation = own.col(c) - mean;
    const Point left = mean_point(deviation, first - before, before);
    const Point right = mean_point(deviation, end, after);
    const double slope = (right.value - left.value) / (right.at - left.at);
    for (Index n = first; n < end; ++n)
      own(n, c) =
          mean[n] + static_cast<float>(left.value + slope * (static_cast<double>(n) - left.at));
  }
}

}  // namespace stageid
