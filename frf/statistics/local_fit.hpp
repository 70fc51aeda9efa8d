#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// A smooth function of frequency, fitted to some bins around a line and evaluated on the line.
///
///   Z(r) = Theta K(r) / D(r) + V(r),   D(r) = 1 + d_1 r + ... + d_n r^n,
/// r is the distance from the line, D is common to all channels (they share the loop's poles), and V is white over the
/// bins with covariance C_V. n = 0 is the local polynomial method. n > 0 is the local rational one, which follows
/// resonances narrower than the bins: a pole near the line is a zero of D.
/// Bins may be in groups, each with its own Theta and a common D: the responses to several excitations, each measured
/// on its own bins.
/// Source: Pintelon and Schoukens, System Identification (2012), chapter 7; McKelvey and Guerin,
/// SYSID 2012 (local rational models).
struct LocalFit {
  Eigen::MatrixXcd value;     ///< channels x groups: Theta k0, the function on the line (D(0) = 1)
  Eigen::MatrixXcd residual;  ///< channels x B (average_locally(): for each fit)
  Eigen::VectorXcd weight;    ///< B: value of a group = sum over its bins of weight Z, for given D
  Eigen::VectorXd
      freedom;  ///< B: residual power of a bin over its noise power, 1 - the fit's share
  Eigen::VectorXd leverage;  ///< of each group: the sum of its |weight|^2
  /// (channels groups) x n: vec(value) times a factor of Cov(d), the uncertainty of D.
  ///   Cov(vec value) = diag(leverage) kron C_V + pole_spread pole_spread^H
  Eigen::MatrixXcd pole_spread;
  int poles = 0;     ///< n
  double dof = 0.0;  ///< residual residual^H / dof is an unbiased C_V
  /// Degrees of freedom of that estimate: dof, or fewer if the number of poles is uncertain.
  double variance_dof = 0.0;
};

/// Input of a fit. Sizes: B bins, p regressors per group.
struct LocalProblem {
  Eigen::MatrixXcd Z;                ///< channels x B, group by group
  Eigen::MatrixXcd K;                ///< p x B
  Eigen::VectorXcd k0;               ///< p: K on the line
  Eigen::VectorXd r;                 ///< B, scaled to |r| <= 1
  std::vector<Eigen::Index> groups;  ///< number of bins of each group; B in total
  Eigen::Index independent_noise;    ///< rank of C_V: in a loop, the number of outputs
  /// D is estimated from this number of leading channels; the others repeat their noise.
  Eigen::Index pole_channels;
  /// Number of channels whose noise the test of a pole counts: 1 is strict, independent_noise is sensitive.
  Eigen::Index tested_noise = 1;
  double chance_of_a_pole = 0.05;  ///< probability that noise alone is taken for a pole, per line
  /// Smallest half-power half-width of a pole, in distances of a group's bins; narrower poles would describe the noise
  /// of a single bin. 0: no limit.
  double narrowest_pole = 0.0;
};

/// Sets the regressors of polynomials in problem.r with a value on the line: K = 1, r, ..., r^order.
void set_polynomials(LocalProblem& problem, Eigen::Index order);

/// Fits with 0, 1, ... `most_poles` poles. A pole is kept only if it lowers the sum of squared residuals more than
/// noise alone does with the probability chance_of_a_pole.
/// @pre B > p groups + most_poles; K of each group has full rank p.
LocalFit fit_locally(const LocalProblem& problem, int most_poles);

/// The mean of the fits with 0, 1, ... `most_poles` poles, weighted by their probability: that of the residual, times
/// chance_of_a_pole for each pole. Selecting a single fit would omit the uncertainty of the selection from the
/// covariance; here the fits' deviations from their mean are columns of pole_spread. residual contains that of every
/// fit, times the root of its weight: channels x B fits. poles: the largest number of any fit.
/// Source: Buckland, Burnham and Augustin, Biometrics 53 (1997); Hoeting et al., Stat. Sci. 14 (1999).
/// @pre as fit_locally()
LocalFit average_locally(const LocalProblem& problem, int most_poles);

}  // namespace stageid
