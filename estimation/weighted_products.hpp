#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "estimation/fit_problem.hpp"

namespace stageid {

/// Two columns whose product over the lines is summed.
struct ColumnPair {
  Eigen::Index left;
  Eigen::Index right;
};
std::vector<ColumnPair> triangular_pairs(Eigen::Index n);                  ///< left >= right
std::vector<ColumnPair> all_pairs(Eigen::Index left, Eigen::Index right);  ///< left outermost

/// Calls task(first pair, count, first line, lines) for every tile of lines of every block of pairs;
/// the blocks in parallel, the tiles of a block in order. Both are fixed, and with them what is
/// summed in them, whatever `threads` is.
using PairBlockTask = std::function<void(Eigen::Index, Eigen::Index, Eigen::Index, Eigen::Index)>;
void for_each_pair_block(Eigen::Index pairs, Eigen::Index lines, int threads,
                         const PairBlockTask& task);

/// Complex columns as two real matrices, N x n each.
struct ComplexColumns {
  const Eigen::MatrixXd& re;
  const Eigen::MatrixXd& im;
};

/// S(c, p) = sum_k W(c, k) Re{ conj(X(k, left_p)) Y(k, right_p) }: the sums that the arrow matrix
/// is made of. The products are functions of frequency alone and shared by all channels, so that
/// this is one (channels x N) (N x pairs) matrix product, taken in tiles of lines.
Eigen::MatrixXd weighted_pair_sums(const Eigen::MatrixXd& W, const ComplexColumns& X,
                                   const ComplexColumns& Y, const std::vector<ColumnPair>& pairs,
                                   int threads);

/// The same with complex weights V (channels x N): sum_k Re{ conj(X) Y V }.
Eigen::MatrixXd weighted_pair_sums(const ComplexColumns& V, const ComplexColumns& X,
                                   const ComplexColumns& Y, const std::vector<ColumnPair>& pairs,
                                   int threads);

/// Rows `rows` of a matrix.
Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& rows);

/// e_b: sum_k Re{ conj(F) W E }, channels of the group x n_f.
Eigen::MatrixXd numerator_gradient(const FitProblem& problem, const BasisGroup& group,
                                   const Residual& E);

}  // namespace stageid
