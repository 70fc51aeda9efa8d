#pragma once

#include <Eigen/Core>

#include "estimation/model/cmif.hpp"

namespace stageid {

/// Standard deviations of the CMIF curves, min(n_y, n_u) x N as cmif() gives them, to first order:
///   d(s^2) = 2 s Re(u^H dG v),   Var(s^2) = 2 s^2 sum_ab |u_a|^2 |v_b|^2 E|dG_ab|^2
/// with the singular value s and vectors u, v of the matrix selected by `kind`, for circular complex errors that
/// are uncorrelated between elements. `variance`, (n_y n_u) x N, is E|dG|^2 of the response.
/// Too small where two curves meet, or where one is below the noise (first order does not hold there).
/// Source: first-order perturbation of a simple singular value.
/// @throws std::invalid_argument if `variance` has another shape than the response, and as cmif().
Eigen::MatrixXd cmif_deviation(const FrfEstimate& frf, CmifKind kind,
                               const Eigen::MatrixXd& variance);

}  // namespace stageid
