#pragma once

#include <Eigen/Core>
#include <mutex>
#include <utility>
#include <vector>

namespace stageid {

/// Reuses large matrices. The kernel must map and clear fresh memory, which for the scatter of a short run takes longer
/// than filling it. Safe for concurrent use.
class MatrixPool {
 public:
  /// A matrix with arbitrary contents and shape.
  Eigen::MatrixXd take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return {};
    Eigen::MatrixXd matrix = std::move(free_.back());
    free_.pop_back();
    return matrix;
  }
  Eigen::MatrixXd take(Eigen::Index rows, Eigen::Index cols) {
    Eigen::MatrixXd matrix = take();
    matrix.resize(rows, cols);
    return matrix;
  }
  void give_back(Eigen::MatrixXd&& matrix) {
    if (matrix.size() == 0) return;
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(matrix));
  }

 private:
  std::mutex mutex_;
  std::vector<Eigen::MatrixXd> free_;
};

}  // namespace stageid
