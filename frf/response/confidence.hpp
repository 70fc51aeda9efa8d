#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "excitation/words/words.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The variance on which a confidence region is based.
enum class VarianceKind : std::uint8_t {
  noise,  ///< for a repetition with the same phases
  total   ///< noise and stochastic nonlinear contributions
};
template <>
inline constexpr std::array kWords<VarianceKind> = {"noise", "total"};

/// Upper limit of |dG|^2 over its variance with the probability `level`: F_{2, 2 nu; level} if the variance was
/// estimated with nu = `dof` complex degrees of freedom. dof = 0: the variance is known, -ln(1 - level).
double squared_error_quantile(double level, double dof);

/// Radii of circles that contain the true response with the probability `level`, (n_y n_u) x N.
///
///   P(|dG| <= radius) = level,  radius^2 = variance F_{2, 2 nu; level},
///   F_{2, 2 nu; level} = nu ((1 - level)^(-1/nu) - 1),
/// for a complex Gaussian dG whose variance E|dG|^2 was estimated with nu complex degrees of freedom
/// (noise_dof, total_dof). The quantile for known variance, -ln(1 - level), is only the limit for large nu:
/// with three periods it covers 84 instead of 95 %.
/// Source: Pintelon and Schoukens, System Identification (2012), section 2.7.
/// @throws std::invalid_argument if level is not in (0, 1), or if the variance or its degrees of freedom are
///         unknown.
Eigen::MatrixXd confidence_radius(const FrfEstimate& frf, double level, VarianceKind kind);

/// Relative variance of a response as one number:
///   mean over lines k and outputs i of  sum_j var G_ij(k) / sum_j |G_ij(k)|^2.
/// Rows are not mixed, because outputs may differ in unit. Zeros of single entries do not dominate it.
/// @throws std::invalid_argument if the variance is unknown, or an output is zero on a line.
double mean_relative_variance(const FrfEstimate& frf, VarianceKind kind);

/// The larger one of noise and total variance, as far as they are known; none if neither is known, or both are zero.
/// @throws as mean_relative_variance()
std::optional<double> worst_relative_variance(const FrfEstimate& frf);

}  // namespace stageid
