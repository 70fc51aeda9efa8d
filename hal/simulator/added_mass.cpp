#include "hal/simulator/added_mass.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "excitation/decompositions/decompositions.hpp"
#include "hal/simulator/mode_transition.hpp"

namespace stageid {
namespace {

/// Indices of the modes by frequency.
std::vector<Eigen::Index> by_frequency(const std::vector<PlantMode>& modes) {
  std::vector<Eigen::Index> order(modes.size());
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
    return modes[a].natural_frequency_hz < modes[b].natural_frequency_hz;
  });
  return order;
}

/// The shapes as columns.
Eigen::MatrixXd columns(const std::vector<PlantMode>& modes, Eigen::VectorXd PlantMode::*shape) {
  Eigen::MatrixXd out((modes[0].*shape).size(), std::ssize(modes));
  for (std::size_t i = 0; i < modes.size(); ++i) out.col(i) = modes[i].*shape;
  return out;
}

}  // namespace

LoadedModes loaded_modes(const std::vector<PlantMode>& modes, const Eigen::VectorXd& shape,
                         double mass_kg) {
  const Eigen::Index n = std::ssize(modes);
  Eigen::VectorXd omega(n), damping(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const PlantMode& mode = modes[i];
    omega[i] = kTwoPi * mode.natural_frequency_hz;
    damping[i] = 2.0 * mode.damping_ratio * omega[i];
  }
  // (I + m phi phi^T)^(-1/2) and its inverse differ from I by a multiple of phi phi^T.
  const double size = shape.squaredNorm();
  const double root = std::sqrt(1.0 + mass_kg * size);
  const auto power = [&](double factor) -> Eigen::MatrixXd {
    Eigen::MatrixXd out = Eigen::MatrixXd::Identity(n, n);
    if (size > 0.0) out += (factor - 1.0) / size * shape * shape.transpose();
    return out;
  };
  const Eigen::MatrixXd inverse_root = power(1.0 / root);
  const auto eigen = symmetric_eigen(inverse_root * omega.cwiseAbs2().asDiagonal() * inverse_root);

  LoadedModes out;
  out.basis.resize(n, n);
  const std::vector<Eigen::Index> order = by_frequency(modes);
  Eigen::VectorXd square(n);
  Eigen::MatrixXd Q(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index i = order[k];
    square[i] = eigen.eigenvalues()[k];
    Q.col(i) = eigen.eigenvectors().col(k);
  }
  out.basis = inverse_root * Q;
  out.inverse = Q.transpose() * power(root);
  const Eigen::MatrixXd actuators = columns(modes, &PlantMode::actuator_shape) * out.basis;
  const Eigen::MatrixXd sensors = columns(modes, &PlantMode::sensor_shape) * out.basis;
  const Eigen::MatrixXd accelerations = columns(modes, &PlantMode::acceleration_shape) * out.basis;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double loaded = std::sqrt(square[i]);
    const double ratio = out.basis.col(i).cwiseAbs2().dot(damping) / (2.0 * loaded);
    out.modes.push_back(
        {loaded / kTwoPi, ratio, actuators.col(i), sensors.col(i), accelerations.col(i)});
  }
  return out;
}

}  // namespace stageid
