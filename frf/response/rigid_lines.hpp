#pragma once

#include <Eigen/Core>

namespace stageid {

/// What three terms, B / s^2 + D + E s^2, leave of flexible modes: a share of a row's rms.
inline constexpr double kRigidModelError = 0.02;
/// Fewest lines on which the terms are fitted.
inline constexpr Eigen::Index kFewestRigidLines = 8;

/// Times its median: omega^2 |G| of a rigid body is no larger.
inline constexpr double kRigidGrowth = 1.5;

/// How many of the lowest lines show a rigid body: those up to 0.7 of the frequency where omega^2 |G| exceeds
/// kRigidGrowth times its median so far. All lines if it nowhere does.
/// @param frequency  ascending, of any unit; lines
/// @param gain       |G| over all channels; lines
Eigen::Index rigid_lines(const Eigen::VectorXd& frequency, const Eigen::VectorXd& gain);

}  // namespace stageid
