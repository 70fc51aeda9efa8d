#include <algorithm>
#include <cmath>
#include <utility>

#include "hal/simulator/plate_modes.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/require.hpp"

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
                    const WaferStageSpec& spec) {
  // The valid mask of Inputs has 64 bits, one per sensor.
  require(!channels.empty() && channels.size() <= 64, "stage: {} {}; must be 1 to 64",
          channels.size(), kind);
  for (const Channel& channel : channels) {
    const double* p = channel.position_m;
    const double* d = channel.direction;
    require(!(std::abs(std::hypot(d[0], d[1], d[2]) - 1.0) > 1e-6),
            "stage: {} {}: direction [{}, {}, {}] is not a unit vector", kind, channel.name, d[0],
            d[1], d[2]);
    require(spec.flexible_modes == 0 || !is_rotation(channel),
            "stage: {} {}: a plate with flexible modes is simulated without rotations; use forces "
            "and translations, or 'modes: 0'",
            kind, channel.name);
    require(channel.gain != 0.0 && std::isfinite(channel.gain),
            "stage: {} {}: gain is {}; must not be zero", kind, channel.name, channel.gain);
    // This form rejects NaN too.
    require(std::abs(p[0]) <= 0.5 * spec.length_x_m * (1.0 + 1e-9) &&
                std::abs(p[1]) <= 0.5 * spec.length_y_m * (1.0 + 1e-9) && std::isfinite(p[2]),
            "stage: {} {}: position_m [{}, {}, {}] is not on the plate of {} x {} m", kind,
            channel.name, p[0], p[1], p[2], spec.length_x_m, spec.length_y_m);
  }
}

void check_plant(const WaferStageSpec& spec) {
  positive("mass_kg", spec.mass_kg);
  for (double inertia : spec.inertia_kg_m2) positive("inertia_kg_m2", inertia);
  for (double hz : spec.suspension_hz) not_negative("suspension_hz", hz);
  damping("suspension_damping", spec.suspension_damping);
  positive("plate length_x_m", spec.length_x_m);
  positive("plate length_y_m", spec.length_y_m);
  check_field(spec.poisson_ratio >= 0.0 && spec.poisson_ratio < 0.5, "plate poisson_ratio",
              spec.poisson_ratio, "at least 0 and below 0.5");
  check_field(spec.flexible_modes >= 0 && spec.flexible_modes <= PlateModes::max_count(),
              "plate modes", spec.flexible_modes, "0 to 40");
  if (spec.flexible_modes > 0) {
    positive("plate first_mode_hz", spec.first_mode_hz);
    require(!spec.flexible_damping.empty(),
            "stage: plate damping is empty; must have at least one value");
  }
  for (double ratio : spec.flexible_damping) damping("plate damping", ratio);
  for (const PlantMode& mode : spec.in_plane_modes) {
    positive("in_plane_modes natural_frequency_hz", mode.natural_frequency_hz);
    damping("in_plane_modes damping_ratio", mode.damping_ratio);
    require(mode.actuator_shape.size() == static_cast<Eigen::Index>(spec.info.actuators.size()) &&
                mode.sensor_shape.size() == static_cast<Eigen::Index>(spec.info.sensors.size()),
            "stage: in_plane_modes: a shape must have one entry per actuator and one per sensor");
  }
}

/// Names the field, its value, and the permitted values.
void require_valid(const WaferStageSpec& spec) {
  positive("sample_rate_hz", spec.info.sample_rate_hz);
  check_plant(spec);
  check_channels("actuators", spec.info.actuators, spec);
  check_channels("sensors", spec.info.sensors, spec);
  not_negative("delay_s", spec.info.delay_s);
  not_negative("noise sensor_m", spec.sensor_noise_m);
  not_negative("noise sensor_coloured_m", spec.sensor_noise_coloured_m);
  positive("noise sensor_corner_hz", spec.sensor_noise_corner_hz);
  not_negative("noise force_n", spec.force_noise_n);
  not_negative("noise sensor_quantum_m", spec.sensor_quantum_m);
  not_negative("noise actuator_quantum_n", spec.actuator_quantum_n);
  not_negative("cubic_stiffness_n_m3", spec.cubic_stiffness_n_m3);
  not_negative("actuator_saturation_n", spec.actuator_saturation_n);
  not_negative("pace", spec.pace);
}

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
