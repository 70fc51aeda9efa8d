#pragma once

#include <Eigen/Core>
#include <numbers>

namespace stageid {

/// rad per cycle.
inline constexpr double kTwoPi = 2.0 * std::numbers::pi;

/// Exact motion of one mode, q'' + 2 zeta omega q' + omega^2 q = f, over `duration_s` with f
/// constant: [q; q'] <- transition [q; q'] + input f.
struct ModeTransition {
  Eigen::Matrix2d transition;
  Eigen::Vector2d input;
};

/// By Taylor series of the scaled problem and repeated doubling. There is no cancellation, so the result is
/// accurate to rounding for a free mass (omega = 0), weak suspensions and any damping.
ModeTransition mode_transition(double omega_rad_s, double damping_ratio, double duration_s);

}  // namespace stageid
