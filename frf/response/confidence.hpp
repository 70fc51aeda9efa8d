#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Which variance a confidence region rests on.
enum class VarianceKind : std::uint8_t {
  noise,  ///< what repeating the same phases would give
  total   ///< noise and stochastic nonlinear contributions
};

/// What |dG|^2 over its variance stays below with the probability `level`: F_{2, 2 nu; level} where the
/// variance was estimated with nu = `dof` complex degrees of freedom; that of a known variance,
/// -ln(1 - level), with dof 0.
double squared_error_quantile(double level, double dof);

/// Radii of circles that hold the true response with the probability `level`, (n_y n_u) x N.
///
///   P(|dG| <= radius) = level,  radius^2 = variance F_{2, 2 nu; level},
///   F_{2, 2 nu; level} = nu ((1 - level)^(-1/nu) - 1),
/// for a complex Gaussian dG whose variance E|dG|^2 was estimated with nu complex degrees of freedom
/// (noise_dof, total_dof). The quantile of known variance, -ln(1 - level), is the limit of large nu
/// only: with three periods it covers 84 instead of 95 %.
/// Source: Pintelon and Schoukens, System Identification (2012), section 2.7.
/// @throws std::invalid_argument if level is not in (0, 1) or the estimate has no such variance or
///         does not say its degrees of freedom.
Eigen::MatrixXd confidence_radius(const FrfEstimate& frf, double level, VarianceKind kind);

}  // namespace stageid
