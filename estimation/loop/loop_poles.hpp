#pragma once

#include "estimation/loop/loop_transfer.hpp"

namespace stageid {

/// Poles of the sampled loop, and how often its Nyquist curve encircles the critical point.
struct LoopPoles {
  double largest_pole = 0.0;     ///< |z| of the outermost closed-loop pole
  double pole_hz = 0.0;          ///< its frequency
  int unstable_closed_loop = 0;  ///< poles outside the unit circle, Z
  int unstable_open_loop = 0;    ///< those of model and controller, P
  /// Clockwise encirclements of 0 by det(I + L) while z runs counter-clockwise along the unit circle, outside of the
  /// poles on it: Z - P.
  int encirclements() const noexcept { return unstable_closed_loop - unstable_open_loop; }
  bool stable() const noexcept { return unstable_closed_loop == 0; }
};

/// Eigenvalues of the exact sampled loop with all its delays.
/// Source of the count: the argument principle for multivariable loops, J. M. Maciejowski, Multivariable Feedback
/// Design (1989), ch. 2.
/// @throws std::invalid_argument as sampled_state_space(), and if a delay is negative
LoopPoles loop_poles(const AdditiveModel& model, const LoopController& controller);

}  // namespace stageid
