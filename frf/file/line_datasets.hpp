#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <string>
#include <vector>

#include "acquisition/files/hdf5_matrices.hpp"
#include "frf/response/frf_estimate.hpp"

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

/// Some channels of columns vec(matrix), as many rows as there are channels; empty if the dataset is missing. Rows of
/// other channels are not written, see ChannelData. @throws FormatError as read_columns()
template <typename Scalar>
VecColumns<Scalar> read_part(const Hdf5File& file, const std::string& dataset, Eigen::Index lines,
                             Eigen::Index rows, Eigen::Index columns, DataRange channels) {
  if (!file.exists(dataset)) return {};
  require_shape(file, dataset, {size_of(lines), size_of(rows), size_of(columns)});
  VecColumns<Scalar> out(rows * columns, lines);
  if (channels.count == 0) return out;
  const Eigen::Index end = channels.first + channels.count;
  const Eigen::Index left = channels.first / rows;
  const Eigen::Index width = (end - 1) / rows + 1 - left;
  // Channels of one column are neighbours in the file, too; of several columns, all rows are read.
  const Eigen::Index top = width == 1 ? channels.first % rows : 0;
  const Eigen::Index height = width == 1 ? channels.count : rows;
  constexpr Eigen::Index kAtOnce = 1 << 20;
  // Whole chunks, so that none is read twice.
  const auto chunk = static_cast<Eigen::Index>(file.rows_of_chunk(dataset));
  const Eigen::Index together =
      chunk * std::max<Eigen::Index>(1, kAtOnce / (height * width) / chunk);
  std::vector<Scalar> data;
  for (Eigen::Index k = 0; k < lines; k += together) {
    const Eigen::Index count = std::min(together, lines - k);
    data.resize(count * height * width);
    file.read_box(dataset, {size_of(k), size_of(top), size_of(left)},
                  {size_of(count), size_of(height), size_of(width)}, data.data());
    for (Eigen::Index i = 0; i < count; ++i)
      for (Eigen::Index u = 0; u < width; ++u) {
        const Eigen::Index of_column = (left + u) * rows;
        for (Eigen::Index y = std::max(top, channels.first - of_column);
             y < std::min(rows, end - of_column); ++y)
          out(of_column + y, k + i) = data[(i * height + y - top) * width + u];
      }
  }
  return out;
}

/// Writes a list of numbers; nothing if it is empty, which means unknown here.
void write_known(Hdf5File& file, const std::string& dataset, const Eigen::VectorXd& values);

/// The inverse; empty if the dataset is missing. @throws FormatError unless it has `size` numbers
Eigen::VectorXd read_known(const Hdf5File& file, const std::string& dataset, Eigen::Index size);

/// @throws FormatError unless it is a list of numbers
Eigen::VectorXd read_vector(const Hdf5File& file, const std::string& dataset);

}  // namespace stageid
