#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/controller_sections.hpp"

namespace stageid {

/// The loop as the controller's closed axes see it.
class AxisLoop {
 public:
  /// @throws std::invalid_argument as controller_sections()
  explicit AxisLoop(const MotionControllerSpec& spec);

  Eigen::Index axes() const noexcept { return sensor_decoupling_.rows(); }
  const std::vector<std::vector<BiquadSection>>& sections() const noexcept { return sections_; }
  const Eigen::MatrixXd& sensor_decoupling() const noexcept { return sensor_decoupling_; }
  const Eigen::MatrixXd& actuator_decoupling() const noexcept { return actuator_decoupling_; }

  /// T_y G T_u. @param plant sensors x actuators
  Eigen::MatrixXcd plant_of_axes(const Eigen::MatrixXcd& plant) const;
  /// C(e^{j omega T}) of every axis.
  Eigen::VectorXcd controllers(double frequency_hz) const;
  /// Loop gain L = T_y G T_u C, axes x axes; the loop is (I + L)^-1.
  Eigen::MatrixXcd gain(const Eigen::MatrixXcd& plant, double frequency_hz) const;

 private:
  double sample_rate_hz_ = 0.0;
  Eigen::MatrixXd sensor_decoupling_;    // closed axes x sensors
  Eigen::MatrixXd actuator_decoupling_;  // actuators x closed axes
  std::vector<std::vector<BiquadSection>> sections_;
};

/// 1 / min |1 + lambda| over the eigenvalues of a loop gain: the largest sensitivity of its characteristic loci,
/// whatever the units of the axes.
double largest_sensitivity(const Eigen::MatrixXcd& loop_gain);

/// How the loop of a configured stage closes.
struct LoopStability {
  bool tested = false;  ///< false: no axis is closed, or the delay makes the loop too large to test
  double largest_pole = 0.0;         ///< |z| of the outermost closed-loop pole; stable below 1
  double pole_hz = 0.0;              ///< its frequency
  double largest_sensitivity = 1.0;  ///< over frequency, see largest_sensitivity()
  double sensitivity_hz = 0.0;       ///< where that is

  bool stable() const noexcept;
};

/// From the eigenvalues of the exact sampled loop of the linear plant: modes, delay and controllers as the simulator
/// and real time have them. Modes that no closed axis drives or sees are not part of it.
/// @throws std::invalid_argument on a controller or plant that makes no sense
LoopStability loop_stability(const WaferStageSpec& spec);

}  // namespace stageid
