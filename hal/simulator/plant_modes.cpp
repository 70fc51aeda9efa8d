#include "hal/simulator/plant_spec.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/simulator/plate_modes.hpp"
#include "hal/simulator/rigid_body.hpp"

namespace stageid {
namespace {

void check_field(bool holds, const char* field, double value, const char* wanted) {
  require(holds && std::isfinite(value), "stage: {} is {}; must be {}", field, value, wanted);
}

void positive(const char* field, double value) {
  check_field(value > 0.0, field, value, "positive");
}

void not_negative(const char* field, double value) {
  check_field(value >= 0.0, field, value, "0 or more");
}

void damping(const char* field, double value) {
  check_field(value >= 0.0 && value < 1.0, field, value, "at least 0 and below 1");
}

void check_channels(const char* kind, const std::vector<Channel>& channels,
                    const PlantSpec& plant) {
  // The valid mask of Inputs has 64 bits, one per sensor.
  require(!channels.empty() && channels.size() <= 64, "stage: {} {}; must be 1 to 64",
          channels.size(), kind);
  for (const Channel& channel : channels) {
    const double* p = channel.position_m;
    const double* d = channel.direction;
    require(!(std::abs(std::hypot(d[0], d[1], d[2]) - 1.0) > 1e-6),
            "stage: {} {}: direction [{}, {}, {}] is not a unit vector", kind, channel.name, d[0],
            d[1], d[2]);
    require(plant.flexible_modes == 0 || !is_rotation(channel),
            "stage: {} {}: a plate with flexible modes is simulated without rotations; use forces "
            "and translations, or 'modes: 0'",
            kind, channel.name);
    require(channel.gain != 0.0 && std::isfinite(channel.gain),
            "stage: {} {}: gain is {}; must not be zero", kind, channel.name, channel.gain);
    // This form rejects NaN too.
    require(std::abs(p[0]) <= 0.5 * plant.length_x_m * (1.0 + 1e-9) &&
                std::abs(p[1]) <= 0.5 * plant.length_y_m * (1.0 + 1e-9) && std::isfinite(p[2]),
            "stage: {} {}: position_m [{}, {}, {}] is not on the plate of {} x {} m", kind,
            channel.name, p[0], p[1], p[2], plant.length_x_m, plant.length_y_m);
  }
}

void check_plant(const StageInfo& info, const PlantSpec& plant) {
  positive("mass_kg", plant.mass_kg);
  for (double inertia : plant.inertia_kg_m2) positive("inertia_kg_m2", inertia);
  for (double hz : plant.suspension_hz) not_negative("suspension_hz", hz);
  damping("suspension_damping", plant.suspension_damping);
  positive("plate length_x_m", plant.length_x_m);
  positive("plate length_y_m", plant.length_y_m);
  check_field(plant.poisson_ratio >= 0.0 && plant.poisson_ratio < 0.5, "plate poisson_ratio",
              plant.poisson_ratio, "at least 0 and below 0.5");
  check_field(plant.flexible_modes >= 0 && plant.flexible_modes <= PlateModes::max_count(),
              "plate modes", plant.flexible_modes, "0 to 40");
  if (plant.flexible_modes > 0) {
    positive("plate first_mode_hz", plant.first_mode_hz);
    require(!plant.flexible_damping.empty(),
            "stage: plate damping is empty; must have at least one value");
  }
  for (double ratio : plant.flexible_damping) damping("plate damping", ratio);
  for (const PlantMode& mode : plant.in_plane_modes) {
    positive("in_plane_modes natural_frequency_hz", mode.natural_frequency_hz);
    damping("in_plane_modes damping_ratio", mode.damping_ratio);
    require(mode.actuator_shape.size() == static_cast<Eigen::Index>(info.actuators.size()) &&
                mode.sensor_shape.size() == static_cast<Eigen::Index>(info.sensors.size()),
            "stage: in_plane_modes: a shape must have one entry per actuator and one per sensor");
  }
}

/// Names the field, its value, and the permitted values.
void require_valid(const StageInfo& info, const PlantSpec& plant) {
  positive("sample_rate_hz", info.sample_rate_hz);
  check_plant(info, plant);
  check_channels("actuators", info.actuators, plant);
  check_channels("sensors", info.sensors, plant);
  not_negative("delay_s", info.delay_s);
  not_negative("cubic_stiffness_n_m3", plant.cubic_stiffness_n_m3);
  not_negative("actuator_saturation_n", plant.actuator_saturation_n);
}

// One mode per degree of freedom, each on its own spring: shape J(:, axis) / sqrt(inertia).
void append_rigid_body(const StageInfo& info, const PlantSpec& plant,
                       std::vector<PlantMode>& modes) {
  const Eigen::MatrixXd actuators = rigid_body_jacobian(info.actuators);
  const Eigen::MatrixXd sensors = rigid_body_jacobian(info.sensors);
  for (std::size_t axis = 0; axis < kRigidAxes; ++axis) {
    const double root = std::sqrt(plant.axis_inertia()[axis]);
    modes.push_back({plant.suspension_hz[axis], plant.suspension_damping,
                     actuators.col(axis) / root, sensors.col(axis) / root});
  }
}

// If the mean square of a shape over the plate is 1, its modal mass is that of the whole plate.
Eigen::VectorXd shape_at(const PlateModes& plate, int mode, double mass_kg,
                         const std::vector<Channel>& channels) {
  Eigen::VectorXd shape(static_cast<Eigen::Index>(channels.size()));
  for (Eigen::Index i = 0; i < shape.size(); ++i) {
    const Channel& channel = channels[i];
    shape[i] = channel.gain * channel.direction[2] *
               plate.shape(mode, channel.position_m[0], channel.position_m[1]) / std::sqrt(mass_kg);
  }
  return shape;
}

void append_flexible(const StageInfo& info, const PlantSpec& plant, std::vector<PlantMode>& modes) {
  if (plant.flexible_modes == 0) return;
  const PlateModes plate({plant.length_x_m, plant.length_y_m, plant.poisson_ratio},
                         plant.flexible_modes);
  for (int i = 0; i < plate.count(); ++i) {
    const std::size_t damping =
        std::min(static_cast<std::size_t>(i), plant.flexible_damping.size() - 1);
    modes.push_back({plant.first_mode_hz * plate.wave_parameter(i) / plate.wave_parameter(0),
                     plant.flexible_damping[damping],
                     shape_at(plate, i, plant.mass_kg, info.actuators),
                     shape_at(plate, i, plant.mass_kg, info.sensors)});
  }
}

Eigen::ArrayXd gains_of(const std::vector<Channel>& channels) {
  Eigen::ArrayXd gains(static_cast<Eigen::Index>(channels.size()));
  for (Eigen::Index i = 0; i < gains.size(); ++i) gains[i] = channels[i].gain;
  return gains;
}

void separate_accelerations(const std::vector<Channel>& sensors, PlantMode& mode) {
  if (std::none_of(sensors.begin(), sensors.end(), is_acceleration)) return;
  mode.acceleration_shape.setZero(mode.sensor_shape.size());
  for (Eigen::Index i = 0; i < mode.sensor_shape.size(); ++i)
    if (is_acceleration(sensors[i])) std::swap(mode.acceleration_shape[i], mode.sensor_shape[i]);
}

}  // namespace

std::vector<PlantMode> plant_modes(const StageInfo& info, const PlantSpec& plant) {
  require_valid(info, plant);
  std::vector<PlantMode> modes;
  append_rigid_body(info, plant, modes);
  append_flexible(info, plant, modes);
  for (PlantMode mode : plant.in_plane_modes) {
    mode.actuator_shape.array() *= gains_of(info.actuators);
    mode.sensor_shape.array() *= gains_of(info.sensors);
    modes.push_back(std::move(mode));
  }
  for (PlantMode& mode : modes) separate_accelerations(info.sensors, mode);
  return modes;
}

}  // namespace stageid
