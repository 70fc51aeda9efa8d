#pragma once

#include <Eigen/Core>
#include <functional>

namespace stageid {

/// R of the matrices factor(0), factor(1), ... stacked, all upper triangular with the same columns. The order of the
/// work does not depend on the number of threads. @pre count > 0
Eigen::MatrixXd stacked_triangle(Eigen::Index count, int threads,
                                 const std::function<Eigen::MatrixXd(Eigen::Index)>& factor);

}  // namespace stageid
