#pragma once

#include <memory>
#include <utility>

namespace stageid {

/// A matrix with many readers and no writers; copying the handle does not copy the data.
template <typename Matrix>
class SharedMatrix {
 public:
  SharedMatrix() : SharedMatrix(Matrix()) {}
  SharedMatrix(Matrix matrix)  // NOLINT(google-explicit-constructor): used as the matrix
      : matrix_(std::make_shared<const Matrix>(std::move(matrix))) {}

  /// Refers to a matrix that is kept elsewhere, at least as long as this handle and its copies.
  static SharedMatrix kept(const Matrix& matrix) {
    SharedMatrix out;
    out.matrix_ = std::shared_ptr<const Matrix>(std::shared_ptr<const Matrix>(), &matrix);
    return out;
  }
  static SharedMatrix kept(Matrix&& matrix) = delete;  // a temporary would dangle

  const Matrix& operator*() const noexcept { return *matrix_; }
  const Matrix* operator->() const noexcept { return matrix_.get(); }
  operator const Matrix&() const noexcept { return *matrix_; }  // NOLINT: as above

 private:
  std::shared_ptr<const Matrix> matrix_;
};

}  // namespace stageid
