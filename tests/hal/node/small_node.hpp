#pragma once

#include "hal/node/stage_node.hpp"
#include "hal/stage/motion_controller.hpp"

namespace stageid::test {

/// A plant without faults.
inline NodePanel good_panel() {
  NodePanel panel;
  panel.gravity_compensator_n = {50.0, 51.5};
  panel.gravity_low_n = 40.0;
  panel.gravity_high_n = 60.0;
  panel.temperature_k = {295.25};
  panel.temperature_high_k = 320.0;
  return panel;
}

/// Of two actuators and one sensor.
inline StageLimits small_limits() {
  StageLimits limits;
  limits.actuator_n = Eigen::Vector2d(10.0, 10.0);
  limits.position_window_m = Eigen::VectorXd::Constant(1, 1e-2);
  return limits;
}

/// The only sensor is at the first of two actuators.
inline MotionControllerSpec one_axis_controller(double sample_rate_hz, double crossover_hz,
                                                double gain_n_per_m) {
  MotionControllerSpec spec;
  spec.sample_rate_hz = sample_rate_hz;
  spec.sensor_decoupling = Eigen::MatrixXd::Ones(1, 1);
  spec.actuator_decoupling = Eigen::MatrixXd::Identity(2, 1);
  AxisController axis;
  axis.crossover_hz = crossover_hz;
  axis.gain = gain_n_per_m;
  spec.axes = {axis};
  return spec;
}

}  // namespace stageid::test
