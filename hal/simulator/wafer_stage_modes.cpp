#include <algorithm>
#include <cmath>
#include <utility>

#include "hal/simulator/plate_modes.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "hal/simulator/simulated_stage.hpp"
#include "hal/simulator/wafer_stage_check.hpp"

namespace stageid {
namespace {

// One mode per degree of freedom, each on its own spring: shape J(:, axis) / sqrt(inertia).
void append_rigid_body(const WaferStageSpec& spec, std::vector<PlantMode>& modes) {
  const Eigen::MatrixXd actuators = rigid_body_jacobian(spec.info.actuators);
  const Eigen::MatrixXd sensors = rigid_body_jacobian(spec.info.sensors);
  for (std::size_t axis = 0; axis < kRigidAxes; ++axis) {
    const double inertia = axis < 3 ? spec.mass_kg : spec.inertia_kg_m2[axis - 3];
    const auto column = static_cast<Eigen::Index>(axis);
    modes.push_back({spec.suspension_hz[axis], spec.suspension_damping,
                     actuators.col(column) / std::sqrt(inertia),
                     sensors.col(column) / std::sqrt(inertia)});
  }
}

// If the mean square of a shape over the plate is 1, its modal mass is that of the whole plate.
Eigen::VectorXd shape_at(const PlateModes& plate, int mode, double mass_kg,
                         const std::vector<Channel>& channels) {
  Eigen::VectorXd shape(static_cast<Eigen::Index>(channels.size()));
  for (Eigen::Index i = 0; i < shape.size(); ++i) {
    const Channel& channel = channels[static_cast<std::size_t>(i)];
    shape[i] = channel.gain * channel.direction[2] *
               plate.shape(mode, channel.position_m[0], channel.position_m[1]) / std::sqrt(mass_kg);
  }
  return shape;
}

void append_flexible(const WaferStageSpec& spec, std::vector<PlantMode>& modes) {
  if (spec.flexible_modes == 0) return;
  const PlateModes plate({spec.length_x_m, spec.length_y_m, spec.poisson_ratio},
                         spec.flexible_modes);
  for (int i = 0; i < plate.count(); ++i) {
    const std::size_t damping =
        std::min(static_cast<std::size_t>(i), spec.flexible_damping.size() - 1);
    modes.push_back({spec.first_mode_hz * plate.wave_parameter(i) / plate.wave_parameter(0),
                     spec.flexible_damping[damping],
                     shape_at(plate, i, spec.mass_kg, spec.info.actuators),
                     shape_at(plate, i, spec.mass_kg, spec.info.sensors)});
  }
}

Eigen::ArrayXd gains_of(const std::vector<Channel>& channels) {
  Eigen::ArrayXd gains(static_cast<Eigen::Index>(channels.size()));
  for (Eigen::Index i = 0; i < gains.size(); ++i)
    gains[i] = channels[static_cast<std::size_t>(i)].gain;
  return gains;
}

void separate_accelerations(const std::vector<Channel>& sensors, PlantMode& mode) {
  if (std::none_of(sensors.begin(), sensors.end(), is_acceleration)) return;
  mode.acceleration_shape.setZero(mode.sensor_shape.size());
  for (Eigen::Index i = 0; i < mode.sensor_shape.size(); ++i)
    if (is_acceleration(sensors[static_cast<std::size_t>(i)]))
      std::swap(mode.acceleration_shape[i], mode.sensor_shape[i]);
}

}  // namespace

std::vector<PlantMode> wafer_stage_modes(const WaferStageSpec& spec) {
  require_valid(spec);
  std::vector<PlantMode> modes;
  append_rigid_body(spec, modes);
  append_flexible(spec, modes);
  for (PlantMode mode : spec.in_plane_modes) {
    mode.actuator_shape.array() *= gains_of(spec.info.actuators);
    mode.sensor_shape.array() *= gains_of(spec.info.sensors);
    modes.push_back(std::move(mode));
  }
  for (PlantMode& mode : modes) separate_accelerations(spec.info.sensors, mode);
  return modes;
}

}  // namespace stageid
