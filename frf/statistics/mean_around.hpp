#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace stageid {

/// Mean over column k and up to `reach` columns on each side, fewer at the ends.
inline Eigen::VectorXd mean_around(const Eigen::MatrixXd& columns, Eigen::Index k,
                                   Eigen::Index reach) {
  const Eigen::Index first = std::max<Eigen::Index>(0, k - reach);
  const Eigen::Index last = std::min(columns.cols(), k + reach + 1);
  return columns.middleCols(first, last - first).rowwise().mean();
}

}  // namespace stageid
