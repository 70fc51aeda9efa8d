#pragma once

#include <Eigen/Core>
#include <complex>
#include <string>
#include <type_traits>
#include <vector>

#include "acquisition/files/hdf5_file.hpp"

namespace stageid {

/// The order of HDF5; that of Eigen is by columns.
template <typename Scalar>
using RowMajor = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// "[4 x 2]"
std::string join_shape(const std::vector<hsize_t>& shape);

/// @throws FormatError unless `dataset` has the shape `wanted`.
void require_shape(const Hdf5File& file, const std::string& dataset,
                   const std::vector<hsize_t>& wanted);

/// A dataset of double, std::complex<double> or long long.
template <typename Scalar>
void write_array(Hdf5File& file, const std::string& dataset, const std::vector<hsize_t>& shape,
                 const Scalar* values) {
  if constexpr (std::is_same_v<Scalar, double>)
    file.write_reals(dataset, shape, values);
  else if constexpr (std::is_same_v<Scalar, std::complex<double>>)
    file.write_complex(dataset, shape, values);
  else
    file.write_integers(dataset, shape, values);
}

/// A dataset of double or std::complex<double>.
template <typename Scalar>
std::vector<Scalar> read_array(const Hdf5File& file, const std::string& dataset) {
  if constexpr (std::is_same_v<Scalar, double>)
    return file.read_reals(dataset);
  else
    return file.read_complex(dataset);
}

template <typename Vector>
void write_vector(Hdf5File& file, const std::string& dataset, const Vector& values) {
  write_array(file, dataset, {static_cast<hsize_t>(values.size())}, values.data());
}

template <typename Derived>
void write_matrix(Hdf5File& file, const std::string& dataset,
                  const Eigen::MatrixBase<Derived>& matrix) {
  // HDF5 stores rows, Eigen columns.
  const Eigen::Matrix<typename Derived::Scalar, Eigen::Dynamic, Eigen::Dynamic> columns =
      matrix.transpose();
  write_array(file, dataset,
              {static_cast<hsize_t>(matrix.rows()), static_cast<hsize_t>(matrix.cols())},
              columns.data());
}

}  // namespace stageid
