#pragma once

#include <complex>

#include "estimation/modal/residual_verdict.hpp"

namespace stageid {

/// The residual of some channels on all lines, divided by the root of its variance; 0 where that is 0: unknown.
/// @param variance n_c x N
Eigen::MatrixXcd white_residual(const FrfEstimate& frf, const ModelBlockResponse& model,
                                const Eigen::MatrixXd& variance, DataRange channels);

/// sum conj(x_k) x_{k + lag} over the lines of all channels. @param x n_c x N  @pre lag < N
std::complex<double> product_at_lag(const Eigen::MatrixXcd& x, Eigen::Index lag);

/// Of so many neighbouring lines of a residual, one is independent: 1 + 2 sum rho(lag), with the real part rho of the
/// autocorrelation over the lines, up to the first lag where it is not clearly positive. The noise of lines is alike
/// where they were interpolated, smoothed, or computed from a record padded with zeros. At least 1.
/// @param variance n_c x N of the noise; empty: 1 is returned
double lines_per_independent(const FrfEstimate& frf, const ModelBlockResponse& model,
                             const Eigen::MatrixXd& variance);

}  // namespace stageid
