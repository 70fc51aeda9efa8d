#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "estimation/problem/fit_problem.hpp"
#include "estimation/products/pair_reduction.hpp"

namespace stageid {

std::vector<ColumnPair> triangular_pairs(Eigen::Index n);  ///< left >= right
/// The symmetric n x n matrix whose lower triangle is given in that order.
Eigen::MatrixXd from_triangle(const Eigen::Ref<const Eigen::VectorXd>& triangle, Eigen::Index n);
std::vector<ColumnPair> all_pairs(Eigen::Index left, Eigen::Index right);  ///< left outermost

constexpr Eigen::Index kTileLines = 256;  // the tiles of weights and products remain in the cache

/// Some channels of a group on some lines: the unit of work of one task.
struct TileRange {
  Eigen::Index first_member;
  Eigen::Index members;
  Eigen::Index first_line;
  Eigen::Index lines;
};

/// The channels of a group that are in `part`, one block per tile of channels, each with all lines: the sums need the
/// memory of one block.
std::vector<TileRange> member_blocks(const BasisGroup& group, DataRange part, Eigen::Index lines);

/// Divides the lines of a block between the threads. Shares depend on sizes only, never on the number of threads, so
/// the sums and their order are always the same.
std::vector<TileRange> line_shares(const TileRange& block);

/// Calls task(first line, lines) for the tiles of a share, in order.
template <typename Task>
void for_each_tile(const TileRange& range, Task&& task) {
  const Eigen::Index end = range.first_line + range.lines;
  for (Eigen::Index k = range.first_line; k < end; k += kTileLines)
    task(k, std::min(kTileLines, end - k));
}

/// Data, weights and residual of a tile, one row per channel (members x lines).
struct DataTile {
  Eigen::MatrixXd W, E_re, E_im;
  /// @param B numerators of the range's channels, members x n_f; empty: E is the data
  void load(const FitProblem& problem, const BasisGroup& group, const TileRange& range,
            const Eigen::MatrixXd& B, Eigen::Index first_line, Eigen::Index lines);
  double squares() const;  ///< sum W |E|^2
};

/// S(c, b) += sum_k W(c, k) |first(k)|^2 base(k, b) over lines first_line + k, for the first columns of the base, as
/// many as S has. PairReduction expands them into sums of products.
void add_fraction_sums(const Eigen::MatrixXd& W, const FractionColumns& fractions,
                       Eigen::Index first_line, Eigen::MatrixXd& S);

/// sums(p, c) += sum_k W(c, k) Re{ conj(X(k, left_p)) Y(k, right_p) } over lines first_line + k, for pairs that are
/// multiplied out. The products are functions of frequency only and shared by all channels, so this is one (pairs x
/// lines) (lines x channels) matrix product.
void add_pair_sums(const Eigen::MatrixXd& W, const SplitMatrix& X, const SplitMatrix& Y,
                   const std::vector<ColumnPair>& pairs, Eigen::Index first_line,
                   Eigen::MatrixXd& sums);

/// The same with complex weights V: sum_k Re{ conj(X) Y V }. Double precision here too: in single precision, the
/// refined-IV step from a start with large residuals is wrong by up to a percent.
void add_pair_sums(const Eigen::MatrixXd& V_re, const Eigen::MatrixXd& V_im, const SplitMatrix& X,
                   const SplitMatrix& Y, const std::vector<ColumnPair>& pairs,
                   Eigen::Index first_line, Eigen::MatrixXd& sums);

/// first, first + 1, ...
std::vector<Eigen::Index> indices(Eigen::Index first, Eigen::Index count);

}  // namespace stageid
