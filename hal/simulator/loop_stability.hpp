#pragma once

#include <Eigen/Core>

#include "hal/simulator/plant_spec.hpp"
#include "hal/stage/stage_spec.hpp"

namespace stageid {

/// 1 / min |1 + lambda| over the eigenvalues lambda of a loop gain: the largest sensitivity of its characteristic
/// loci. It does not depend on the units of the channels.
double largest_sensitivity(const Eigen::MatrixXcd& loop_gain);

/// Stability of the loop of a stage with a known plant.
struct LoopStability {
  bool tested = false;        ///< false: the loop is open, or the model is too large or not finite
  double largest_pole = 0.0;  ///< |z| of the outermost closed-loop pole; stable below 1
  double pole_hz = 0.0;       ///< its frequency
  double largest_sensitivity = 1.0;  ///< over frequency, see largest_sensitivity()
  double sensitivity_hz = 0.0;       ///< frequency of the largest sensitivity

  bool stable() const noexcept;
};

/// Computed from the eigenvalues of the exact sampled loop of the linear plant, with modes, delay and controller
/// as in the simulator. Modes that the controller does not excite or measure are excluded.
/// @throws std::invalid_argument for an invalid controller or plant
LoopStability loop_stability(const StageSpec& stage, const PlantSpec& plant);

}  // namespace stageid
