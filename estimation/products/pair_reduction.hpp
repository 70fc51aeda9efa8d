#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "estimation/problem/fraction_columns.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {

/// Two columns whose product is summed over the lines.
struct ColumnPair {
  Eigen::Index left;
  Eigen::Index right;
};

/// Computes sums sum_k V Re{conj(X) Y} of many pairs of columns from the sums of their fractions.
///
/// On the imaginary axis conj(x) = -x, on the unit circle conj(x) = 1/x, so that
///   conj(1/(x - m)) / (x - l) = -[q_l + conj(q_m)] / (l + m*),     x = j omega
///                             = [1 + l q_l + conj(m q_m)] / (1 - l m*),  x = e^{j omega T}
/// and by differentiation to l and m* the same for squares: a product of two fractions is a sum of them.
/// n functions then need the sums of 8 n columns, not of n^2 products. The terms cancel if a pole is close to
/// the conjugate of another (a mode with itself, overlapping modes, far below the highest line). Such pairs,
/// and columns that are not fractions, are multiplied out.
class PairReduction {
 public:
  /// @param left, right columns of `columns`, indexed by the pairs; all three must outlive this
  PairReduction(const FractionColumns& columns, const std::vector<FractionColumn>& left,
                const std::vector<FractionColumn>& right, std::vector<ColumnPair> pairs);

  const std::vector<ColumnPair>& pairs() const noexcept { return pairs_; }
  bool is_reduced(std::size_t pair) const noexcept { return place_[pair] < 0; }
  /// The pairs to multiply out, in their order.
  const std::vector<ColumnPair>& direct() const noexcept { return direct_; }

  /// The sums of all pairs, pairs x members.
  /// @param S members x base columns: sum_k V(c, k) |first|^2 base(k)
  /// @param direct the sums of the direct pairs, pairs x members
  Eigen::MatrixXd expand(const Eigen::MatrixXd& S, const Eigen::MatrixXd& direct,
                         int threads) const;
  /// The same for complex V, sum_k Re{conj(X) Y V}; S is sum_k V conj(first) base(k) for columns Y
  /// without `first`.
  Eigen::MatrixXd expand(const Eigen::MatrixXd& S_re, const Eigen::MatrixXd& S_im,
                         const Eigen::MatrixXd& direct, int threads) const;

  /// The sum over the channels of `factor` times the sums of a reduced pair.
  double weighted_sum(std::size_t pair, const Eigen::MatrixXd& S,
                      const Eigen::Ref<const Eigen::VectorXd>& factor) const;

  /// Calls task(pair) for all pairs on up to `threads` threads.
  template <typename Task>
  void for_each_pair(int threads, Task&& task) const;

 private:
  struct Terms;
  Terms terms(std::size_t pair) const;
  template <typename Row>
  Eigen::MatrixXd expand_rows(const Eigen::MatrixXd& direct, int threads, Row&& row) const;

  const FractionColumns* columns_;
  const std::vector<FractionColumn>* left_;
  const std::vector<FractionColumn>* right_;
  std::vector<ColumnPair> pairs_;
  std::vector<ColumnPair> direct_;
  std::vector<Eigen::Index> place_;  // index of a pair in direct_; -1: reduced
};

template <typename Task>
void PairReduction::for_each_pair(int threads, Task&& task) const {
  constexpr std::size_t kAtOnce = 4096;
  for_each_task(threads, static_cast<int>((pairs_.size() + kAtOnce - 1) / kAtOnce), [&](int part) {
    const std::size_t first = static_cast<std::size_t>(part) * kAtOnce;
    for (std::size_t p = first; p < std::min(pairs_.size(), first + kAtOnce); ++p) task(p);
  });
}

}  // namespace stageid
