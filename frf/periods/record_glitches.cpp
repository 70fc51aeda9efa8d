#include "frf/periods/record_glitches.hpp"

#include <algorithm>
#include <cmath>

#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

using Eigen::Index;

constexpr Index kNeighbours = 128;
constexpr double kLeastGlitch = 8.0;
constexpr double kNormalMedian = 0.6745;  // of |x|, x standard normal

/// |second difference| of x[n + N] - x[n], relative to the scatter of its neighbours; zeros at the ends.
Eigen::ArrayXd unevenness(const Eigen::Ref<const Eigen::VectorXd>& x, Index N) {
  const Index count = x.size() - N;
  const Eigen::VectorXd d = x.tail(count) - x.head(count);
  Eigen::ArrayXd h = Eigen::ArrayXd::Zero(count);
  h.segment(1, count - 2) =
      (d.head(count - 2) - 2.0 * d.segment(1, count - 2) + d.tail(count - 2)).array().abs();
  // In quantized signals most differences are zero.
  const double least = h.mean();
  std::vector<double> block;
  Eigen::ArrayXd ratio(count);
  for (Index first = 0; first < count; first += kNeighbours) {
    const Index size = std::min(kNeighbours, count - first);
    const Index from = std::min(first, std::max<Index>(0, count - kNeighbours));
    block.assign(h.data() + from, h.data() + std::min(count, from + kNeighbours));
    const double median = order_statistic(block, 0.5);
    const double scatter = (median > 0.0 ? median : least) / kNormalMedian;
    ratio.segment(first, size) = h.segment(first, size) / std::max(scatter, 1e-300);
  }
  return ratio;
}

}  // namespace

std::vector<Glitch> find_glitches(const Eigen::MatrixXd& samples, Index channels, Index N,
                                  int periods) {
  if (periods < 3 || N < 2 * kNeighbours) return {};
  const double least_ratio = std::max(kLeastGlitch, std::sqrt(static_cast<double>(N)));
  std::vector<Glitch> worst(periods);
  for (Index c = 0; c < channels; ++c) {
    const Eigen::ArrayXd ratio = unevenness(samples.col(c).head(N * periods), N);
    // A glitch affects three second differences, so neighbours count as one.
    const auto stands_out = [&](int difference, Index n) {
      const Index at = difference * N + n;
      const Index first = std::max<Index>(0, at - 1);
      return ratio.segment(first, std::min<Index>(3, ratio.size() - first)).maxCoeff() >
             least_ratio;
    };
    for (int p = 0; p + 1 < periods; ++p)
      for (Index n = 0; n < N; ++n) {
        const double here = ratio[p * N + n];
        if (!(here > least_ratio)) continue;
        // d of period p depends on periods p and p + 1; d of p + 1, or of p - 1, identifies the wrong one.
        const bool later = p + 2 < periods ? stands_out(p + 1, n) : !stands_out(p - 1, n);
        if (!later && p == 0 && n < kNeighbours) continue;
        Glitch& glitch = worst[later ? p + 1 : p];
        if (here > glitch.ratio) glitch = {later ? p + 1 : p, c, here};
      }
  }
  std::erase_if(worst, [](const Glitch& glitch) { return glitch.ratio == 0.0; });
  if (static_cast<int>(worst.size()) > (periods - 1) / 2) return {};
  return worst;
}

}  // namespace stageid
