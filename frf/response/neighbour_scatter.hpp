#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Complex degrees of freedom of a scatter.
inline constexpr Eigen::Index kScatterDof = 9;

/// Deviation of the lines of a response from a smooth function of frequency.
struct LineScatter {
  /// (n_y n_u) x N, unit of |response|^2: variance of the response, including noise and stochastic nonlinear
  /// contributions.
  Eigen::MatrixXd variance;
  double dof = 0.0;  ///< complex degrees of freedom of each
  /// Median of variance / noise_variance over channels and lines, 1 for a linear plant; 0: the noise is unknown.
  double over_noise = 0.0;

  /// Whether most lines scatter by clearly more than their noise: the median of a linear plant is 1 within a few percent,
  /// more if modes are narrow. The scatter of some lines may be that of resonances narrower than their spacing.
  bool shows_distortion() const noexcept { return over_noise > kDistorted; }
  static constexpr double kDistorted = 2.0;
};

/// The scatter around a local rational function of twelve neighbouring lines, see fit_locally().
///
/// A nonlinear plant distorts every line of a random-phase multisine identically in all periods, so the periods'
/// scatter does not contain the distortion. It differs between realizations and between lines, whereas the response
/// is smooth. With one realization, only the lines can reveal it. If modes are narrower than the line spacing, the
/// variance is too large.
/// Source: Pintelon and Schoukens, System Identification (2012), chapters 4 and 7.
/// @param threads 0: all cores; does not affect the result
/// @returns empty matrices if there are too few lines
LineScatter line_scatter(const FrfEstimate& frf, int threads = 0);

/// The variance of line_scatter() for any values on lines: a response or a residual. @param lines n_c x N
/// @returns n_c x N; empty if there are too few lines
Eigen::MatrixXd scatter_variance(const Eigen::VectorXd& frequency_hz, const Eigen::MatrixXcd& lines,
                                 int threads = 0);

/// Whether there are enough lines for a scatter.
bool has_line_scatter(Eigen::Index lines) noexcept;

/// Whether the lines are too coarse for line_scatter(), so that the response itself looks like scatter. There are
/// three criteria:
///   - fewer lines than twice twelve;
///   - every other line has clearly more scatter, because noise and distortion do not depend on the line spacing;
///   - half of all lines scatter by more than a fifth of the response.
bool lines_are_coarse(const FrfEstimate& frf, const LineScatter& scatter, int threads = 0);

}  // namespace stageid
