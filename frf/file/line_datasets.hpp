#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/files/hdf5_file.hpp"

/// Conversion between columns vec(matrix), one per line, and datasets [lines x rows x columns].
namespace stageid {

template <typename Scalar>
using VecColumns = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;

template <typename Scalar>
using RowMajor = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <typename Scalar>
std::vector<Scalar> to_c_order(const VecColumns<Scalar>& columns, Eigen::Index rows) {
  const Eigen::Index n = columns.rows();
  std::vector<Scalar> data(static_cast<std::size_t>(columns.size()));
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    Eigen::Map<RowMajor<Scalar>>(data.data() + k * n, rows, n / rows) =
        Eigen::Map<const VecColumns<Scalar>>(columns.col(k).data(), rows, n / rows);
  }
  return data;
}

template <typename Scalar>
VecColumns<Scalar> from_c_order(const std::vector<Scalar>& data, Eigen::Index rows,
                                Eigen::Index columns) {
  const Eigen::Index n = rows * columns;
  const Eigen::Index lines = static_cast<Eigen::Index>(data.size()) / n;
  VecColumns<Scalar> result(n, lines);
  for (Eigen::Index k = 0; k < lines; ++k) {
    Eigen::Map<VecColumns<Scalar>>(result.col(k).data(), rows, columns) =
        Eigen::Map<const RowMajor<Scalar>>(data.data() + k * n, rows, columns);
  }
  return result;
}

/// "[4 x 2]"
std::string join_shape(const std::vector<hsize_t>& shape);

/// @throws FormatError unless `dataset` has the shape `wanted`.
void require_shape(const Hdf5File& file, const std::string& dataset,
                   const std::vector<hsize_t>& wanted);

inline hsize_t size_of(Eigen::Index n) { return static_cast<hsize_t>(n); }

}  // namespace stageid
