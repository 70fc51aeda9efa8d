#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/controller_sections.hpp"

namespace stageid {

/// The loop in the coordinates of the controller's closed axes.
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

/// 1 / min |1 + lambda| over the eigenvalues lambda of a loop gain: the largest sensitivity of its characteristic
/// loci. It does not depend on the units of the axes.
double largest_sensitivity(const Eigen::MatrixXcd& loop_gain);

/// Stability of the loop of a configured stage.
struct LoopStability {
  bool tested = false;        ///< false: no axis is closed, or the model is too large or not finite
  double largest_pole = 0.0;  ///< |z| of the outermost closed-loop pole; stable below 1
  double pole_hz = 0.0;       ///< its frequency
  double largest_sensitivity = 1.0;  ///< over frequency, see largest_sensitivity()
  double sensitivity_hz = 0.0;       ///< frequency of the largest sensitivity

  bool stable() const noexcept;
};

/// Computed from the eigenvalues of the exact sampled loop of the linear plant, with modes, delay and controllers
/// as in the simulator. Modes that no closed axis excites or measures are excluded.
/// @throws std::invalid_argument for an invalid controller or plant
LoopStability loop_stability(const WaferStageSpec& spec);

}  // namespace stageid
