#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/fraction_columns.hpp"

namespace stageid {

/// Two columns whose product over the lines is summed.
struct ColumnPair {
  Eigen::Index left;
  Eigen::Index right;
};

/// Sums sum_k V Re{conj(X) Y} of many pairs of columns from the sums of their fractions.
///
/// On the imaginary axis conj(x) = -x, on the unit circle conj(x) = 1/x, so that
///   conj(1/(x - m)) / (x - l) = -[q_l + conj(q_m)] / (l + m*),     x = j omega
///                             = [1 + l q_l + conj(m q_m)] / (1 - l m*),  x = e^{j omega T}
/// and by differentiation to l and m* the same for squares: a product of two fractions is a sum of them.
/// n functions then need the sums of 8 n columns, not of n^2 products. Where poles are close to each
/// other's conjugates (a mode with itself, modes that overlap, far below the highest line), the terms
/// cancel; such pairs, and columns that are no fractions, remain to be multiplied out.
class PairReduction {
 public:
  /// @param left, right columns of `columns` that the pairs index
  PairReduction(const FractionColumns& columns, const std::vector<FractionColumn>& left,
                const std::vector<FractionColumn>& right, std::vector<ColumnPair> pairs);

  const std::vector<ColumnPair>& pairs() const noexcept { return pairs_; }
  bool is_reduced(std::size_t pair) const noexcept { return begin_[pair] != begin_[pair + 1]; }
  /// Those to multiply out, in their order.
  const std::vector<ColumnPair>& direct() const noexcept { return direct_; }

  /// One pair's sums, a value a channel. @param S members x base columns: sum_k V(c, k) |first|^2 base(k)
  Eigen::VectorXd sum(std::size_t pair, const Eigen::MatrixXd& S) const;

  /// All pairs' sums, pairs x members. @param direct the direct pairs' sums, likewise
  Eigen::MatrixXd expand(const Eigen::MatrixXd& S, const Eigen::MatrixXd& direct) const;
  /// The same for complex V, sum_k Re{conj(X) Y V}; S is sum_k V conj(first) base(k) for columns Y
  /// without `first`.
  Eigen::MatrixXd expand(const Eigen::MatrixXd& S_re, const Eigen::MatrixXd& S_im,
                         const Eigen::MatrixXd& direct) const;

 private:
  struct Term {
    Eigen::Index column;  // of the base
    std::complex<double> factor;
  };
  template <typename Row>
  Eigen::MatrixXd expand_rows(const Eigen::MatrixXd& direct, Eigen::Index members, Row&& row) const;

  std::vector<ColumnPair> pairs_;
  std::vector<ColumnPair> direct_;
  std::vector<std::size_t> begin_;  // of a pair's terms; none: direct
  std::vector<Term> terms_;
};

}  // namespace stageid
