#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace stageid {

/// Pairs rows with columns, each at most once, such that the sum of costs is smallest, in O(n^3). An unpaired row and
/// an unpaired column together cost `limit`, so no pair costs as much.
/// @return per row its column
/// @param cost may be NaN: not paired. @pre not minus infinity
/// Source: R. Jonker and A. Volgenant, Computing 38 (1987) 325, shortest augmenting paths.
std::vector<std::optional<Eigen::Index>> least_cost_pairs(const Eigen::MatrixXd& cost,
                                                          double limit);

}  // namespace stageid
