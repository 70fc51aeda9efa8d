#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/files/hdf5_matrices.hpp"

/// Conversion between columns vec(matrix), one per line, and datasets [lines x rows x columns].
namespace stageid {

template <typename Scalar>
using VecColumns = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;

template <typename Scalar>
std::vector<Scalar> to_c_order(const VecColumns<Scalar>& columns, Eigen::Index rows) {
  const Eigen::Index n = columns.rows();
  std::vector<Scalar> data(columns.size());
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
  const Eigen::Index lines = std::ssize(data) / n;
  VecColumns<Scalar> result(n, lines);
  for (Eigen::Index k = 0; k < lines; ++k) {
    Eigen::Map<VecColumns<Scalar>>(result.col(k).data(), rows, columns) =
        Eigen::Map<const RowMajor<Scalar>>(data.data() + k * n, rows, columns);
  }
  return result;
}

inline hsize_t size_of(Eigen::Index n) { return static_cast<hsize_t>(n); }

/// Writes columns vec(matrix), `rows` rows each; nothing if there are none.
template <typename Scalar>
void write_columns(Hdf5File& file, const std::string& dataset, const VecColumns<Scalar>& columns,
                   Eigen::Index rows) {
  if (columns.size() == 0) return;
  const std::vector<Scalar> data = to_c_order(columns, rows);
  write_array(file, dataset,
              {size_of(columns.cols()), size_of(rows), size_of(columns.rows() / rows)},
              data.data());
}

/// The inverse; empty if the dataset is missing. @throws FormatError unless it is [lines x rows x columns]
template <typename Scalar = double>
VecColumns<Scalar> read_columns(const Hdf5File& file, const std::string& dataset,
                                Eigen::Index lines, Eigen::Index rows, Eigen::Index columns) {
  if (!file.exists(dataset)) return {};
  require_shape(file, dataset, {size_of(lines), size_of(rows), size_of(columns)});
  return from_c_order(read_array<Scalar>(file, dataset), rows, columns);
}

/// Writes a list of numbers; nothing if it is empty, which means unknown here.
void write_known(Hdf5File& file, const std::string& dataset, const Eigen::VectorXd& values);

/// The inverse; empty if the dataset is missing. @throws FormatError unless it has `size` numbers
Eigen::VectorXd read_known(const Hdf5File& file, const std::string& dataset, Eigen::Index size);

/// @throws FormatError unless it is a list of numbers
Eigen::VectorXd read_vector(const Hdf5File& file, const std::string& dataset);

}  // namespace stageid
