#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "hal/stage/stage.hpp"

namespace stageid {

/// One mode of a plant:
///   (sensor_shape + s^2 acceleration_shape) actuator_shape^T / (s^2 + 2 zeta omega s + omega^2),
/// mass-normalized, in the units of the channels.
struct PlantMode {
  double natural_frequency_hz = 0.0;
  double damping_ratio = 0.0;
  Eigen::VectorXd actuator_shape;           ///< size actuators
  Eigen::VectorXd sensor_shape;             ///< size sensors
  Eigen::VectorXd acceleration_shape = {};  ///< of sensors of acceleration; empty: none
};

/// The plant of a stage: a free rectangular plate on weak springs. Needed to simulate the stage and to predict its
/// signals.
struct PlantSpec {
  // Rigid body
  double mass_kg = 0.0;
  double inertia_kg_m2[3] = {0., 0., 0.};              ///< about x, y, z
  double suspension_hz[6] = {0., 0., 0., 0., 0., 0.};  ///< gravity compensators: x y z Rx Ry Rz
  double suspension_damping = 0.0;

  // Free plate (Rayleigh-Ritz with Legendre polynomials): out-of-plane flexible modes
  double length_x_m = 0.0;
  double length_y_m = 0.0;
  double first_mode_hz = 0.0;  ///< scales the plate's stiffness
  double poisson_ratio = 0.3;
  int flexible_modes = 0;  ///< number of modes, including those above the band of interest
  std::vector<double> flexible_damping;  ///< one per mode, the last repeats
  std::vector<PlantMode> in_plane_modes;

  double cubic_stiffness_n_m3 = 0.0;   ///< on the rigid z motion; 0: off (linear)
  double actuator_saturation_n = 0.0;  ///< 0: off

  /// Of x, y, z, Rx, Ry, Rz.
  std::array<double, 6> axis_inertia() const noexcept {
    return {mass_kg, mass_kg, mass_kg, inertia_kg_m2[0], inertia_kg_m2[1], inertia_kg_m2[2]};
  }
};

/// All modes of the plant: rigid-body ones on their suspension first, then flexible out of plane by
/// frequency, then in plane.
/// @throws std::invalid_argument naming the field, its value, and the permitted values.
std::vector<PlantMode> plant_modes(const StageInfo& info, const PlantSpec& plant);

/// The exact frequency response of the plant without controller, sensors x actuators, through zero-order hold, delay
/// and sampler: G_d(e^{j omega T}).
Eigen::MatrixXcd sampled_response(const std::vector<PlantMode>& modes, double delay_s,
                                  double sample_rate_hz, double frequency_hz);

}  // namespace stageid
