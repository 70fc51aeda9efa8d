#pragma once

#include <Eigen/Core>
#include <vector>

#include "hal/simulator/plant_spec.hpp"

namespace stageid {

/// The modes of a plant that carries a mass m, which moves with a point along one direction.
///
/// In the coordinates q of the modes without it, with phi the shape at that point,
///   (I + m phi phi^T) q'' + C q' + K q = f,   K = diag(omega^2), C = diag(2 zeta omega).
/// The columns of B are its undamped modes, B^T (I + m phi phi^T) B = I. They are found from the symmetric matrix
/// M^(-1/2) K M^(-1/2), so frequencies and shapes are exact. Damping ratios are those of the diagonal of B^T C B: the
/// coupling of modes by damping is neglected, as in a plant with one damping ratio per mode.
struct LoadedModes {
  /// In the order of those without mass: the k-th lowest replaces the k-th lowest.
  std::vector<PlantMode> modes;
  Eigen::MatrixXd basis;    ///< B: coordinates without the mass = B coordinates with it
  Eigen::MatrixXd inverse;  ///< B^-1
};

/// @param shape phi, kg^(-1/2)   @pre natural frequencies above 0; 1 + mass_kg |shape|^2 above 0
LoadedModes loaded_modes(const std::vector<PlantMode>& modes, const Eigen::VectorXd& shape,
                         double mass_kg);

}  // namespace stageid
