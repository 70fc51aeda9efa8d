#pragma once

#include <Eigen/Core>

#include "frf/frf_estimate.hpp"

namespace stageid {

/// Is the scatter over realizations more than noise? One answer for each output, input and band.
struct NonlinearityTest {
  Eigen::MatrixXd band_hz;     ///< bands x 2: first and last frequency, both in the band
  Eigen::MatrixXd p_value;     ///< (n_y n_u) x bands: chance of so much scatter on a linear plant
  Eigen::MatrixXd distortion;  ///< (n_y n_u) x bands, relative to |G|: see nonlinearity_test()
};

/// Noise against stochastic nonlinear contributions.
///
/// On a linear plant F = total_variance / noise_variance has on every line the distribution
/// F(2 (M - 1), 2 nu), nu = noise_dof. Its upper tail p_k is uniform then, whatever the noise's
/// colour, and lines are independent, so that over the K lines of a band (Fisher)
///   -2 sum_k ln p_k  is chi-square with 2 K degrees of freedom;
/// p_value is its upper tail: p_value < 0.01 is a false alarm in one of a hundred tests. Bands are
/// octaves from the first line on, joined until each has at least 8 lines.
///   distortion^2 = sum_k max(0, M (total - noise)) / sum_k |G|^2,
/// the power of the stochastic nonlinear contributions of one realization.
///
/// The estimate must come from FrfMethod::periodic: with lpm neighbouring lines share bins.
/// Source: Pintelon and Schoukens, System Identification (2012), sections 4.3 and 7.3.
/// @throws std::invalid_argument without both variances, or if total_dof is not M - 1 >= 1 or
///         noise_dof is unknown.
NonlinearityTest nonlinearity_test(const FrfEstimate& frf);

}  // namespace stageid
