#pragma once

#include <pybind11/complex.h>
#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace stageid {

/// Columns that are vec of an n_y x n_u matrix, as a read-only array [N x n_y x n_u] over the same memory; `owner`
/// keeps the memory alive. None for an empty matrix.
template <typename Scalar>
pybind11::object lines_view(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& columns,
                            Eigen::Index n_y, const pybind11::handle& owner) {
  namespace py = pybind11;
  if (columns.size() == 0) return py::none();
  const auto bytes = static_cast<py::ssize_t>(sizeof(Scalar));
  py::array_t<Scalar> array({columns.cols(), n_y, columns.rows() / n_y},
                            {columns.rows() * bytes, bytes, n_y * bytes}, columns.data(), owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// The same for a matrix without another owner, which is moved into the array.
template <typename Scalar>
pybind11::object lines_moved(Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>&& columns,
                             Eigen::Index n_y) {
  using Columns = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  auto kept = std::make_unique<Columns>(std::move(columns));
  Columns* memory = kept.get();
  const pybind11::capsule owner(kept.release(), [](void* p) { delete static_cast<Columns*>(p); });
  return lines_view(*memory, n_y, owner);
}

/// The reverse, as a copy: Python arrays have any order, and the estimate owns its memory.
/// @throws std::invalid_argument "NAME: ..." unless the shape is N x n_y x n_u.
template <typename Scalar>
Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> columns_of(
    const pybind11::array_t<Scalar, pybind11::array::forcecast>& array, const char* name) {
  if (array.ndim() != 3)
    throw std::invalid_argument(std::string(name) + ": has " + std::to_string(array.ndim()) +
                                " axes; expected [lines x outputs x inputs]");
  const auto in = array.template unchecked<3>();
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> columns(in.shape(1) * in.shape(2),
                                                                in.shape(0));
  for (Eigen::Index k = 0; k < in.shape(0); ++k)
    for (Eigen::Index j = 0; j < in.shape(2); ++j)
      for (Eigen::Index i = 0; i < in.shape(1); ++i) columns(i + in.shape(1) * j, k) = in(k, i, j);
  return columns;
}

}  // namespace stageid
