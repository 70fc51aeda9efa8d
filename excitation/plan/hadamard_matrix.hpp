#pragma once

#include <Eigen/Core>

namespace stageid {

/// Whether hadamard_matrix() supports a size: 1, 2, and the sizes of Paley's constructions over prime fields
/// with Sylvester's doubling: 4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48, not 52.
bool has_hadamard_matrix(int size);

/// H with entries +-1 and H H^T = size I; its first row and first column are all +1.
/// @throws std::invalid_argument naming the nearest supported sizes if `size` is not supported.
Eigen::MatrixXd hadamard_matrix(int size);

}  // namespace stageid
