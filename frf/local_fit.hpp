#pragma once

#include <Eigen/Core>

namespace stageid {

/// A smooth function of frequency, fitted to a few bins around a line and evaluated on the line.
///
///   Z(r) = Theta K(r) / D(r) + V(r),   D(r) = 1 + d_1 r + ... + d_n r^n,
/// r the distance from the line, D common to all channels (they share the loop's poles), V white
/// over the bins with covariance C_V. n = 0 is the local polynomial method, n > 0 the local rational
/// one, which follows a resonance narrower than the bins: near the line a pole is D = 0.
/// Source: Pintelon and Schoukens, System Identification (2012), chapter 7; McKelvey and Guerin,
/// SYSID 2012 (local rational models).
struct LocalFit {
  Eigen::VectorXcd value;     ///< Theta k0: the function on the line (D(0) = 1), a value a channel
  Eigen::MatrixXcd residual;  ///< channels x B
  double leverage = 0.0;      ///< Cov(value) = leverage C_V + pole_spread pole_spread^H
  Eigen::MatrixXcd pole_spread;  ///< channels x n: what not knowing D adds
  int poles = 0;                 ///< n
  double dof = 0.0;              ///< of residual residual^H / dof, an unbiased C_V
};

/// What there is to fit. Sizes: B bins, p regressors.
struct LocalProblem {
  Eigen::MatrixXcd Z;              ///< channels x B
  Eigen::MatrixXcd K;              ///< p x B
  Eigen::VectorXcd k0;             ///< p: K on the line
  Eigen::VectorXd r;               ///< B, scaled to |r| <= 1
  Eigen::Index independent_noise;  ///< rank of C_V: in a loop the outputs, U follows them
};

/// Fits with 0, 1, ... `most_poles` poles and keeps a pole only if it lowers the sum of squared
/// residuals further than noise alone does on one of twenty lines.
/// @pre B > p + most_poles; K has full rank.
LocalFit fit_locally(const LocalProblem& problem, int most_poles);

}  // namespace stageid
