#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// [N x n_y x n_u] in C order, as in files, from columns that are vec of an n_y x n_u matrix.
template <typename Scalar>
std::vector<Scalar> c_order(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& columns,
                            Eigen::Index n_y) {
  std::vector<Scalar> data;
  data.reserve(static_cast<std::size_t>(columns.size()));
  const Eigen::Index n_u = columns.rows() / n_y;
  for (Eigen::Index k = 0; k < columns.cols(); ++k)
    for (Eigen::Index i = 0; i < n_y; ++i)
      for (Eigen::Index j = 0; j < n_u; ++j) data.push_back(columns(i + n_y * j, k));
  return data;
}

}  // namespace stageid
