#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "estimation/products/equation_method.hpp"

namespace stageid {

/// Columns X_c of every channel, all of one width, and the weights between two channels.
struct ChannelPairs {
  Eigen::Index channels = 0;
  Eigen::Index lines = 0;
  int threads = 1;
  std::function<SplitMatrix(Eigen::Index c, IndexRange lines)> columns;
  /// W(c, d) on some lines, lines x 1; empty: zero.
  std::function<SplitMatrix(Eigen::Index c, Eigen::Index d, IndexRange lines)> between;
};

/// sum_k Re{X_c^H W(c, d) X_d} of the columns in a range, for every range: element (c + n_c p, d + n_c q) belongs to
/// its columns p and q, in the order of vec of channels x columns. W must be Hermitian.
std::vector<Eigen::MatrixXd> pair_grams(const ChannelPairs& pairs,
                                        const std::vector<IndexRange>& ranges);

}  // namespace stageid
