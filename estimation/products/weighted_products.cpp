#include "estimation/products/weighted_products.hpp"

#include <algorithm>
#include <complex>
#include <numeric>

namespace stageid {
namespace {

constexpr Eigen::Index kBlockPairs = 192;
constexpr Eigen::Index kShares = 8;  // per block, if there are that many tiles of lines

/// sums(p, .) += V times the product of a pair, which `fill` writes; a block of pairs at a time.
template <typename Fill>
void add_products(const Eigen::MatrixXd& V, const std::vector<ColumnPair>& pairs,
                  Eigen::MatrixXd& sums, const Fill& fill) {
  const auto n_pairs = std::ssize(pairs);
  Eigen::MatrixXd products(V.cols(), std::min(kBlockPairs, n_pairs));
  for (Eigen::Index first = 0; first < n_pairs; first += kBlockPairs) {
    const Eigen::Index count = std::min(kBlockPairs, n_pairs - first);
    for (Eigen::Index p = 0; p < count; ++p) fill(pairs[first + p], products.col(p));
    sums.middleRows(first, count).noalias() += products.leftCols(count).transpose() * V.transpose();
  }
}

}  // namespace

std::vector<ColumnPair> triangular_pairs(Eigen::Index n) {
  std::vector<ColumnPair> pairs;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) pairs.push_back({i, j});
  return pairs;
}

Eigen::MatrixXd from_triangle(const Eigen::Ref<const Eigen::VectorXd>& triangle, Eigen::Index n) {
  Eigen::MatrixXd out(n, n);
  Eigen::Index p = 0;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) out(i, j) = out(j, i) = triangle[p++];
  return out;
}

std::vector<ColumnPair> all_pairs(Eigen::Index left, Eigen::Index right) {
  std::vector<ColumnPair> pairs;
  for (Eigen::Index i = 0; i < left; ++i)
    for (Eigen::Index j = 0; j < right; ++j) pairs.push_back({i, j});
  return pairs;
}

std::vector<TileRange> member_blocks(const BasisGroup& group, DataRange part, Eigen::Index lines) {
  std::vector<TileRange> blocks;
  const auto begin = group.channels.begin();  // the channels are sorted
  const auto end = std::lower_bound(begin, group.channels.end(), part.first + part.count);
  for (auto at = std::lower_bound(begin, end, part.first); at != end;) {
    const auto next = std::lower_bound(at, end, (*at / kTileChannels + 1) * kTileChannels);
    blocks.push_back({at - begin, next - at, 0, lines});
    at = next;
  }
  return blocks;
}

std::vector<TileRange> line_shares(const TileRange& block) {
  const Eigen::Index tiles = (block.lines + kTileLines - 1) / kTileLines;
  const Eigen::Index lines = (tiles + kShares - 1) / kShares * kTileLines;
  std::vector<TileRange> shares;
  for (Eigen::Index k = 0; k < block.lines; k += lines)
    shares.push_back({block.first_member, block.members, block.first_line + k,
                      std::min(lines, block.lines - k)});
  return shares;
}

void DataTile::load(const FitProblem& problem, const BasisGroup& group, const TileRange& range,
                    const Eigen::MatrixXd& B, Eigen::Index first_line, Eigen::Index lines) {
  const Eigen::Index* channels = group.channels.data() + range.first_member;
  const bool in_order = channels[range.members - 1] - channels[0] == range.members - 1;  // sorted
  /// Calls take(to, from): the index of a channel in the tile and in the column of a line.
  const auto gather = [&](const auto& take) {
    if (in_order)
      for (Eigen::Index r = 0; r < range.members; ++r) take(r, channels[0] + r);
    else
      for (Eigen::Index r = 0; r < range.members; ++r) take(r, channels[r]);
  };
  W.resize(range.members, lines);
  E_re.resize(range.members, lines);
  E_im.resize(range.members, lines);
  for (Eigen::Index k = 0; k < lines; ++k) {
    const double* weights = problem.W->data() + problem.channels() * (first_line + k);
    double* w = W.data() + range.members * k;
    gather([&](Eigen::Index to, Eigen::Index from) { w[to] = weights[from]; });
    if (problem.middle) {
      const LineVariance& v = *problem.middle;
      const double* variance = v.matrix->data() + problem.channels() * (first_line + k);
      const double divisor = v.divisor[first_line + k];
      gather([&](Eigen::Index to, Eigen::Index from) {
        w[to] = w[to] * w[to] * (variance[from] / divisor);
      });
    }
    const std::complex<double>* data = problem.G->data() + problem.channels() * (first_line + k);
    double* re = E_re.data() + range.members * k;
    double* im = E_im.data() + range.members * k;
    gather([&](Eigen::Index to, Eigen::Index from) {
      re[to] = data[from].real();
      im[to] = data[from].imag();
    });
  }
  if (B.size() == 0) return;
  E_re.noalias() -= B * group.F.re.middleRows(first_line, lines).transpose();
  E_im.noalias() -= B * group.F.im.middleRows(first_line, lines).transpose();
}

double DataTile::squares() const {
  return (W.array() * (E_re.array().square() + E_im.array().square())).sum();
}

void add_fraction_sums(const Eigen::MatrixXd& W, const FractionColumns& fractions,
                       Eigen::Index first_line, Eigen::MatrixXd& S) {
  const auto tile = [&](const Eigen::MatrixXd& x) {
    return x.block(first_line, 0, W.cols(), x.cols());
  };
  const Eigen::MatrixXd weighted =
      W * (tile(fractions.first.re).cwiseAbs2() + tile(fractions.first.im).cwiseAbs2())
              .col(0)
              .asDiagonal();
  S.noalias() += weighted * fractions.base->block(first_line, 0, W.cols(), S.cols());
}

void add_pair_sums(const Eigen::MatrixXd& W, const SplitMatrix& X, const SplitMatrix& Y,
                   const std::vector<ColumnPair>& pairs, Eigen::Index first_line,
                   Eigen::MatrixXd& sums) {
  const Eigen::Index n = W.cols();
  add_products(W, pairs, sums, [&](ColumnPair pair, auto&& product) {
    const auto [i, j] = pair;
    product = X.re.col(i).segment(first_line, n).cwiseProduct(Y.re.col(j).segment(first_line, n)) +
              X.im.col(i).segment(first_line, n).cwiseProduct(Y.im.col(j).segment(first_line, n));
  });
}

void add_pair_sums(const Eigen::MatrixXd& V_re, const Eigen::MatrixXd& V_im, const SplitMatrix& X,
                   const SplitMatrix& Y, const std::vector<ColumnPair>& pairs,
                   Eigen::Index first_line, Eigen::MatrixXd& sums) {
  const Eigen::Index n = V_re.cols();
  Eigen::MatrixXd V(V_re.rows(), 2 * n);
  V << V_re, -V_im;
  add_products(V, pairs, sums, [&](ColumnPair pair, auto&& product) {
    const auto x_re = X.re.col(pair.left).segment(first_line, n);
    const auto x_im = X.im.col(pair.left).segment(first_line, n);
    const auto y_re = Y.re.col(pair.right).segment(first_line, n);
    const auto y_im = Y.im.col(pair.right).segment(first_line, n);
    product.head(n) = x_re.cwiseProduct(y_re) + x_im.cwiseProduct(y_im);
    product.tail(n) = x_re.cwiseProduct(y_im) - x_im.cwiseProduct(y_re);
  });
}

std::vector<Eigen::Index> indices(Eigen::Index first, Eigen::Index count) {
  std::vector<Eigen::Index> out(count);
  std::iota(out.begin(), out.end(), first);
  return out;
}

}  // namespace stageid
