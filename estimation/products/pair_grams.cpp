#include "estimation/products/pair_grams.hpp"

#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

/// Adds the products of channel c and the following ones on a tile of lines.
void add_channel(const ChannelPairs& pairs, const std::vector<SplitMatrix>& X, Eigen::Index c,
                 IndexRange lines, const std::vector<IndexRange>& ranges,
                 std::vector<Eigen::MatrixXd>& out) {
  const SplitMatrix& left = X[c];
  SplitMatrix right;
  Eigen::MatrixXd gram;
  for (Eigen::Index d = c; d < pairs.channels; ++d) {
    const SplitMatrix weight = pairs.between(c, d, lines);
    if (weight.cols() == 0) continue;
    const auto w_re = weight.re.col(0).array();
    const auto w_im = weight.im.col(0).array();
    const SplitMatrix& other = X[d];
    right.re = other.re.array().colwise() * w_re - other.im.array().colwise() * w_im;
    right.im = other.im.array().colwise() * w_re + other.re.array().colwise() * w_im;
    for (std::size_t r = 0; r < ranges.size(); ++r) {
      const auto [first, n] = ranges[r];
      gram.noalias() = left.re.middleCols(first, n).transpose() * right.re.middleCols(first, n);
      gram.noalias() += left.im.middleCols(first, n).transpose() * right.im.middleCols(first, n);
      const auto rows = Eigen::seqN(c, n, pairs.channels);
      const auto cols = Eigen::seqN(d, n, pairs.channels);
      out[r](rows, cols) += gram;
      if (d != c) out[r](cols, rows) += gram.transpose();
    }
  }
}

}  // namespace

std::vector<Eigen::MatrixXd> pair_grams(const ChannelPairs& pairs,
                                        const std::vector<IndexRange>& ranges) {
  std::vector<Eigen::MatrixXd> out;
  for (const IndexRange& range : ranges) {
    const Eigen::Index n = pairs.channels * range.count;
    out.emplace_back(Eigen::MatrixXd::Zero(n, n));
  }
  std::vector<SplitMatrix> X(pairs.channels);
  const auto channels = static_cast<int>(pairs.channels);
  for (const IndexRange lines : ranges_of(pairs.lines, kTileLines)) {
    for_each_task(pairs.threads, channels, [&](int c) { X[c] = pairs.columns(c, lines); });
    for_each_task(pairs.threads, channels,
                  [&](int c) { add_channel(pairs, X, c, lines, ranges, out); });
  }
  return out;
}

}  // namespace stageid
