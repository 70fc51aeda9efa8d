#pragma once

#include <Eigen/Core>

namespace stageid {

/// True for the sizes hadamard_matrix() can make: 1, 2, and what Paley's constructions over prime
/// fields and Sylvester's doubling reach: 4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48, not 52.
bool has_hadamard_matrix(int size);

/// H with entries +-1 and H H^T = size I; its first row and first column are all +1.
/// @throws std::invalid_argument naming the nearest sizes that exist, if this one does not.
Eigen::MatrixXd hadamard_matrix(int size);

}  // namespace stageid
