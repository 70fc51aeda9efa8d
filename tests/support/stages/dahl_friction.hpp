#pragma once

#include <cmath>

namespace stageid {

/// Dry friction with presliding: a spring for small motion, the full force for large motion, and hysteresis
/// between them. The force depends on the position only, not on the velocity.
/// Source: P. R. Dahl, A solid friction model (1968), exponent 1.
class DahlFriction {
 public:
  /// @param force_n of sliding, positive; @param stiffness_n_m at a reversal of the motion.
  DahlFriction(double force_n, double stiffness_n_m)
      : force_n_(force_n), per_m_(stiffness_n_m / force_n) {}

  void reset(double position_m = 0.0) noexcept {
    position_m_ = position_m;
    value_n_ = 0.0;
  }
  /// Exact for motion in one direction since the last call. @returns the force on the body, N
  double move_to(double position_m) noexcept {
    const double way = position_m - position_m_;
    const double end = std::copysign(force_n_, way);
    value_n_ = end + (value_n_ - end) * std::exp(-per_m_ * std::abs(way));
    position_m_ = position_m;
    return -value_n_;
  }

 private:
  double force_n_;
  double per_m_;
  double position_m_ = 0.0;
  double value_n_ = 0.0;
};

}  // namespace stageid
