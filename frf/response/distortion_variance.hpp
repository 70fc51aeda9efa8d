#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Distortion of one realization of a nonlinear plant, as known from an estimate.
struct Distortion {
  Eigen::MatrixXd band_hz;  ///< bands x 2: first and last line; empty: unknown
  Eigen::MatrixXd level;  ///< (n_y n_u) x bands: rms over that of the row of G, of one realization
};

/// E|dG|^2 of the mean of `realizations` due to the distortion and the noise of `frf`, (n_y n_u) x N. Lines outside the
/// bands use the nearest band. @pre frf has a noise_variance and the channels of the distortion
Eigen::MatrixXd variance_with(const Distortion& distortion, const FrfEstimate& frf);

/// The total variance of a nonlinear plant, from few realizations.
struct DistortionVariance {
  Distortion distortion;
  Eigen::MatrixXd variance;  ///< (n_y n_u) x N, unit of |response|^2
  double dof = 0.0;          ///< approximate complex degrees of freedom
};

/// With M realizations, the total variance of a line has M - 1 degrees of freedom, too few for weights. It varies too
/// much over the lines (distortion follows the response) for a mean over neighbouring ones. Distortion acts as forces
/// of all actuators, whichever is excited, so the expected variance at output y is
///   v_k = noise_k + alpha mean_u |G_yu,k|^2,
/// with one alpha per channel and octave (at least 8 lines), by least squares on total - noise with weights 1/v^2. The
/// estimate is the mean of the total variance and v, weighted by their degrees of freedom, M - 1 and 8. It approaches
/// the total variance for many realizations and v for few, and it is larger for outlying lines.
/// Source: docs/theory.md, section 3 (total variance). The weighted mean is that of the inverse gamma prior, as in
/// Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004) article 3.
/// @pre both variances are known, total_dof >= 1
DistortionVariance distortion_variance(const FrfEstimate& frf);

/// Correlation of the outputs' errors where noise and distortion add up: C_E of the noise, and G G^H of the distortion,
/// which acts as independent forces of the actuators. Both are scaled so that the diagonal, y, has the means over the
/// inputs of noise_variance and of variance - noise_variance.
/// @param variance  (n_y n_u) x N, at least noise_variance
/// @returns (n_y n_y) x N, Hermitian, in the layout of FrfEstimate::residual_covariance
Eigen::MatrixXcd covariance_with_distortion(const FrfEstimate& frf,
                                            const Eigen::MatrixXd& variance);

}  // namespace stageid
