#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// How far the lines of a response stand off a smooth function of frequency.
struct LineScatter {
  /// (n_y n_u) x N, unit of |response|^2: variance of the response, noise and stochastic nonlinear
  /// contributions together.
  Eigen::MatrixXd variance;
  double dof = 0.0;  ///< complex degrees of freedom of each
  /// Median over channels and lines of variance / noise_variance, 1 for a linear plant; 0: the noise is unknown.
  double over_noise = 0.0;
};

/// The scatter about a local rational function of twelve neighbouring lines, see fit_locally().
///
/// A nonlinear plant distorts every line of a random-phase multisine, and all periods in the same way: what the
/// periods tell of the noise says nothing of it. From realization to realization it is another one, and so it is
/// from line to line, about a response that is smooth; with one realization the lines are all there is to ask.
/// Where modes are narrower than the lines are apart the variance comes out too large.
/// Source: Pintelon and Schoukens, System Identification (2012), chapters 4 and 7.
/// @param threads 0: all cores; the result does not depend on it
/// @returns empty matrices if there are too few lines
LineScatter line_scatter(const FrfEstimate& frf, int threads = 0);

/// Whether the lines are too coarse for it, so that the response itself looks like scatter: they are fewer than
/// twice twelve, every other line scatters clearly more (noise and distortion do not care how far the lines are
/// apart, what a local function cannot follow does), or half of all scatter by more than a fifth of the response.
bool lines_are_coarse(const FrfEstimate& frf, const LineScatter& scatter, int threads = 0);

}  // namespace stageid
