#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// A smooth function of frequency, fitted to a few bins around a line and evaluated on the line.
///
///   Z(r) = Theta K(r) / D(r) + V(r),   D(r) = 1 + d_1 r + ... + d_n r^n,
/// r the distance from the line, D common to all channels (they share the loop's poles), V white
/// over the bins with covariance C_V. n = 0 is the local polynomial method, n > 0 the local rational
/// one, which follows a resonance narrower than the bins: near the line a pole is D = 0.
/// Bins may come in groups, each with a Theta of its own and D common to all: the responses to several
/// excitations, each seen on its own bins.
/// Source: Pintelon and Schoukens, System Identification (2012), chapter 7; McKelvey and Guerin,
/// SYSID 2012 (local rational models).
struct LocalFit {
  Eigen::MatrixXcd value;     ///< channels x groups: Theta k0, the function on the line (D(0) = 1)
  Eigen::MatrixXcd residual;  ///< channels x B (average_locally(): for each fit)
  Eigen::VectorXcd weight;    ///< B: value of a group = sum over its bins of weight Z, for given D
  Eigen::VectorXd
      freedom;  ///< B: power of a bin's residual over that of its noise; 1 - fit's share
  Eigen::VectorXd leverage;  ///< of each group: the sum of its |weight|^2
  /// (channels groups) x n, vec(value) from the factor of Cov(d): what not knowing D adds.
  ///   Cov(vec value) = diag(leverage) kron C_V + pole_spread pole_spread^H
  Eigen::MatrixXcd pole_spread;
  int poles = 0;     ///< n
  double dof = 0.0;  ///< residual residual^H / dof is an unbiased C_V
  /// What that is worth as an estimate: dof, or fewer where the number of poles is not sure.
  double variance_dof = 0.0;
};

/// What there is to fit. Sizes: B bins, p regressors of each group.
struct LocalProblem {
  Eigen::MatrixXcd Z;                ///< channels x B, group by group
  Eigen::MatrixXcd K;                ///< p x B
  Eigen::VectorXcd k0;               ///< p: K on the line
  Eigen::VectorXd r;                 ///< B, scaled to |r| <= 1
  std::vector<Eigen::Index> groups;  ///< bins of each group; B together
  Eigen::Index independent_noise;    ///< rank of C_V: in a loop the outputs, U follows them
  /// The first so many channels tell D; the others, which repeat their noise, follow.
  Eigen::Index pole_channels;
  /// Channels whose noise the test of a pole counts: 1 is strict, independent_noise sharp.
  Eigen::Index tested_noise = 1;
  double chance_of_a_pole = 0.05;  ///< that noise alone is taken for one, on a line
  /// Poles nearer to the axis of r than so many distances of a group's bins are not taken: they would
  /// describe the noise of a single bin. Half of the half-power width. 0: any.
  double narrowest_pole = 0.0;
};

/// Fits with 0, 1, ... `most_poles` poles and keeps a pole only if it lowers the sum of squared
/// residuals further than noise alone does with a chance of chance_of_a_pole.
/// @pre B > p groups + most_poles; K of each group has full rank p.
LocalFit fit_locally(const LocalProblem& problem, int most_poles);

/// The mean of the fits with 0, 1, ... `most_poles` poles, each as probable as its residual says, a pole
/// being unlikely by as much as fit_locally() asks of it. Choosing one of them would leave out of the
/// covariance that another could have been chosen; here the fits' distances from their mean are columns
/// of pole_spread. residual holds every fit's, times the root of its share: channels x B fits.
/// poles: the most of any fit.
/// Source: Buckland, Burnham and Augustin, Biometrics 53 (1997); Hoeting et al., Stat. Sci. 14 (1999).
/// @pre as fit_locally()
LocalFit average_locally(const LocalProblem& problem, int most_poles);

}  // namespace stageid
