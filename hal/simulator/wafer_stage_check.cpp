#include "hal/simulator/wafer_stage_check.hpp"

#include <cmath>

#include "hal/simulator/plate_modes.hpp"
#include "hal/stage/require.hpp"

namespace stageid {
namespace {

void check(bool holds, const char* field, double value, const char* wanted) {
  require(holds && std::isfinite(value), "stage: {} is {}; must be {}", field, value, wanted);
}

void positive(const char* field, double value) { check(value > 0.0, field, value, "positive"); }

void not_negative(const char* field, double value) {
  check(value >= 0.0, field, value, "0 or more");
}

void damping(const char* field, double value) {
  check(value >= 0.0 && value < 1.0, field, value, "at least 0 and below 1");
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
  check(spec.poisson_ratio >= 0.0 && spec.poisson_ratio < 0.5, "plate poisson_ratio",
        spec.poisson_ratio, "at least 0 and below 0.5");
  check(spec.flexible_modes >= 0 && spec.flexible_modes <= PlateModes::max_count(), "plate modes",
        spec.flexible_modes, "0 to 40");
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

}  // namespace

void require_valid(const WaferStageSpec& spec) {
  positive("sample_rate_hz", spec.info.sample_rate_hz);
  check_plant(spec);
  check_channels("actuators", spec.info.actuators, spec);
  check_channels("sensors", spec.info.sensors, spec);
  not_negative("delay_s", spec.delay_s);
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

}  // namespace stageid
