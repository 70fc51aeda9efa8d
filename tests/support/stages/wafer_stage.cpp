#include "tests/support/stages/wafer_stage.hpp"

#include <fmt/format.h>

#include <initializer_list>
#include <string>

#include "hal/simulator/rigid_body.hpp"

namespace stageid::test {
namespace {

Channel channel(const std::string& name, const char* unit, double x_m, double y_m, char axis) {
  Channel c{name, unit, {x_m, y_m, 0.0}, {0.0, 0.0, 0.0}};
  c.direction[axis - 'x'] = 1.0;
  return c;
}

std::vector<Channel> actuators() {
  constexpr double kZ[13][2] = {{-0.26, -0.21}, {0.0, -0.26}, {0.26, -0.21}, {-0.11, -0.09},
                                {0.11, -0.09},  {-0.26, 0.0}, {0.0, 0.0},    {0.26, 0.0},
                                {-0.11, 0.09},  {0.11, 0.09}, {-0.26, 0.21}, {0.0, 0.26},
                                {0.26, 0.21}};
  std::vector<Channel> list;
  for (int i = 0; i < 13; ++i)
    list.push_back(channel(fmt::format("z{}", i + 1), "N", kZ[i][0], kZ[i][1], 'z'));
  list.push_back(channel("x1", "N", -0.28, -0.20, 'x'));
  list.push_back(channel("x2", "N", -0.28, 0.20, 'x'));
  list.push_back(channel("y1", "N", -0.20, -0.28, 'y'));
  list.push_back(channel("y2", "N", 0.20, -0.28, 'y'));
  return list;
}

std::vector<Channel> sensors() {
  return {channel("sz1", "m", -0.255, -0.258, 'z'), channel("sz2", "m", 0.274, -0.280, 'z'),
          channel("sz3", "m", -0.176, 0.285, 'z'),  channel("sz4", "m", 0.178, 0.277, 'z'),
          channel("sx1", "m", 0.300, -0.220, 'x'),  channel("sx2", "m", 0.300, 0.220, 'x'),
          channel("sy1", "m", 0.0, 0.303, 'y')};
}

Eigen::VectorXd shape(Eigen::Index size, Eigen::Index first, std::initializer_list<double> values) {
  Eigen::VectorXd v = Eigen::VectorXd::Zero(size);
  for (const double value : values) v[first++] = value;
  return v;
}

void set_plant(PlantSpec& plant) {
  plant.mass_kg = 20.0;
  plant.inertia_kg_m2[0] = 0.61206;
  plant.inertia_kg_m2[1] = 0.6;
  plant.inertia_kg_m2[2] = 1.21206;
  constexpr double kSuspension[6] = {0.3, 0.3, 0.4, 0.5, 0.5, 0.3};
  for (std::size_t i = 0; i < 6; ++i) plant.suspension_hz[i] = kSuspension[i];
  plant.suspension_damping = 0.1;
  plant.length_x_m = 0.6;
  plant.length_y_m = 0.606;
  plant.first_mode_hz = 180.0;
  plant.poisson_ratio = 0.17;
  plant.flexible_modes = 23;
  plant.flexible_damping = {0.012,  0.010, 0.009,  0.006, 0.005, 0.006,  0.005, 0.0045,
                            0.004,  0.005, 0.0035, 0.004, 0.005, 0.0045, 0.004, 0.005,
                            0.0045, 0.005, 0.006,  0.006, 0.007, 0.008,  0.010};
  plant.in_plane_modes = {
      {820.0, 0.010, shape(17, 13, {0.10, -0.10, 0.04, 0.05}), shape(7, 4, {0.10, -0.10, 0.04})},
      {1240.0, 0.008, shape(17, 15, {0.12, 0.11}), shape(7, 4, {0.02, 0.02, -0.12})},
      {1730.0, 0.008, shape(17, 13, {0.12, 0.13}), shape(7, 4, {-0.13, -0.12})}};
}

void set_limits(StageLimits& limits) {
  limits.actuator_n = Eigen::VectorXd::Constant(17, 50.0);
  limits.actuator_n.tail(4).setConstant(100.0);
  limits.slew_n_s = 1e4 * limits.actuator_n;
  limits.thermal_rms_n = Eigen::VectorXd::Constant(17, 15.0);
  limits.thermal_rms_n.tail(4).setConstant(30.0);
  limits.thermal_time_constant_s = 10.0;
  limits.position_window_m = Eigen::VectorXd::Constant(7, 200e-6);
  limits.position_window_m.tail(3).setConstant(500e-6);
}

MotionControllerSpec controller(const SimulatedSpec& spec) {
  AxisController in_plane;
  in_plane.crossover_hz = 30.0;
  in_plane.integrator_hz = 3.0;
  in_plane.lead_zero_hz = 9.0;
  in_plane.lead_pole_hz = 120.0;
  in_plane.lowpass_hz = 300.0;
  AxisController out_of_plane;
  out_of_plane.crossover_hz = 40.0;
  out_of_plane.integrator_hz = 3.0;
  out_of_plane.lead_zero_hz = 12.0;
  out_of_plane.lead_pole_hz = 150.0;
  out_of_plane.lowpass_hz = 320.0;
  return motion_controller_spec(
      spec.info.sample_rate_hz, spec.info.actuators, spec.info.sensors,
      {in_plane, in_plane, out_of_plane, out_of_plane, out_of_plane, in_plane},
      spec.plant.axis_inertia());
}

}  // namespace

SimulatedSpec silent_wafer_stage_spec() {
  SimulatedSpec spec;
  spec.info.name = std::string("wafer stage");
  spec.info.backend = std::string("sim");
  spec.info.sample_rate_hz = 1e4;
  spec.info.delay_s = 130e-6;
  spec.info.actuators = actuators();
  spec.info.sensors = sensors();
  set_plant(spec.plant);
  set_limits(spec.limits);
  spec.simulation.sensor_noise_corner_hz = 20.0;
  spec.simulation.seed = 1;
  spec.controller = controller(spec);
  return spec;
}

SimulatedSpec wafer_stage_spec() {
  SimulatedSpec spec = silent_wafer_stage_spec();
  spec.simulation.sensor_noise_m = 0.3e-9;
  spec.simulation.sensor_noise_coloured_m = 0.5e-9;
  spec.simulation.force_noise_n = 3e-3;
  return spec;
}

SimulatedSpec small_stage_spec() {
  SimulatedSpec spec;
  spec.info.name = std::string("small");
  spec.info.backend = std::string("sim");
  spec.info.sample_rate_hz = 1e3;
  spec.info.actuators = {channel("a1", "N", 0.2, 0.1, 'z'), channel("a2", "N", -0.1, 0.3, 'z')};
  spec.info.sensors = {channel("s1", "m", 0.5, 0.5, 'z')};
  spec.plant.mass_kg = 2.0;
  for (double& inertia : spec.plant.inertia_kg_m2) inertia = 0.2;
  for (double& hz : spec.plant.suspension_hz) hz = 1.0;
  spec.plant.suspension_damping = 0.1;
  spec.plant.length_x_m = 1.0;
  spec.plant.length_y_m = 1.0;
  spec.plant.first_mode_hz = 80.0;
  spec.plant.flexible_modes = 1;
  spec.plant.flexible_damping = {0.02};
  return spec;
}

}  // namespace stageid::test
