#pragma once

#include <Eigen/Core>
#include <string>
#include <type_traits>
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
  const Eigen::Index lines = std::ssize(data) / n;
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

/// Writes columns vec(matrix), `rows` rows each; nothing if there are none.
template <typename Scalar>
void write_columns(Hdf5File& file, const std::string& dataset, const VecColumns<Scalar>& columns,
                   Eigen::Index rows) {
  if (columns.size() == 0) return;
  const std::vector<Scalar> data = to_c_order(columns, rows);
  const std::vector<hsize_t> shape = {size_of(columns.cols()), size_of(rows),
                                      size_of(columns.rows() / rows)};
  if constexpr (std::is_same_v<Scalar, double>)
    file.write_reals(dataset, shape, data.data());
  else
    file.write_complex(dataset, shape, data.data());
}

/// The inverse; empty if the dataset is missing. @throws FormatError unless it is [lines x rows x columns]
template <typename Scalar = double>
VecColumns<Scalar> read_columns(const Hdf5File& file, const std::string& dataset,
                                Eigen::Index lines, Eigen::Index rows, Eigen::Index columns) {
  if (!file.exists(dataset)) return {};
  require_shape(file, dataset, {size_of(lines), size_of(rows), size_of(columns)});
  if constexpr (std::is_same_v<Scalar, double>)
    return from_c_order(file.read_reals(dataset), rows, columns);
  else
    return from_c_order(file.read_complex(dataset), rows, columns);
}

/// Writes a list of numbers; nothing if it is empty, which means unknown here.
void write_known(Hdf5File& file, const std::string& dataset, const Eigen::VectorXd& values);

/// @throws FormatError unless it is a list of numbers
Eigen::VectorXd read_vector(const Hdf5File& file, const std::string& dataset);

}  // namespace stageid
