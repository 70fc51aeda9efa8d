#pragma once

#include <Eigen/Core>
#include <functional>

#include "excitation/threads/team.hpp"

namespace stageid {

/// The rows and columns of R in A = Q R after the first `eliminated`; A has at least as many rows as columns and is
/// overwritten.
Eigen::MatrixXd triangle_after(Eigen::Index eliminated, Eigen::MatrixXd& A);

/// R of the matrices factor(0), factor(1), ... of the channels stacked, all upper triangular with the same columns. The
/// order of the work does not depend on the workers, which factor their own channels. @pre channels > 0
Eigen::MatrixXd stacked_triangle(Eigen::Index channels, const Workers& workers,
                                 const std::function<Eigen::MatrixXd(Eigen::Index)>& factor);

}  // namespace stageid
