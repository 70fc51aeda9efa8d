#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/joint_equations.hpp"
#include "estimation/products/equation_method.hpp"
#include "estimation/uncertainty/data_noise.hpp"

namespace stageid {

/// Covariance of the numerators b_c = nu_c - Z a of one channel: of their own part nu, and between nu and the globals
/// a.
struct ChannelCovariance {
  Eigen::MatrixXd own;                ///< Cov(nu_c)
  Eigen::MatrixXd cross;              ///< Cov(a, nu_c)
  Eigen::MatrixXd Z;                  ///< the channel's rows of M_bb^-1 M_ba
  Eigen::MatrixXd equations_inverse;  ///< the channel's block of M_bb^-1
};

/// What the covariances between channels follow from, see dense_covariances().
struct CovarianceParts {
  Eigen::MatrixXd globals;          ///< as in ParameterCovariance
  Eigen::MatrixXd globals_inverse;  ///< (M^-1)_aa
  double residual_scale = 1.0;      ///< as in ParameterCovariance
  std::vector<ChannelCovariance> channels;
};

struct ParameterCovariance {
  Eigen::MatrixXd globals;             ///< of denominator coefficients and delays
  Eigen::MatrixXd numerator_variance;  ///< of B, n_c x n_f
  Eigen::MatrixXd response_variance;   ///< E|dP|^2, n_c x N; empty if not requested
  double residual_scale = 1.0;  ///< factor included in the variances (unknown or too small noise)
  std::shared_ptr<CovarianceParts> parts;  ///< if requested
};

/// Parts of a ParameterCovariance to compute besides the deviations.
struct WantedCovariance {
  bool response = false;  ///< needs as much memory as the data
  bool parts = false;     ///< for covariances between numerators of different channels
};

/// First-order covariance of the estimate. With M = sum Re{J^H W J} and K = sum Re{J^H W C W J},
///   Cov(beta) = 1/2 M^-1 K M^-1,   which is [2 sum Re{J^H C^-1 J}]^-1 for W = C^-1
/// (docs/theory.md, section 11). The arrow structure gives the requested parts: with Z the rows of M_bb^-1 M_ba of
/// the channel and nu its numerators for given globals a,
///   b_c = nu_c - Z a,   dP_c = (J_a - F Z) a + F nu_c.
/// The noise of the outputs is correlated by disturbance forces, that of the inputs by the controller. Diagonal
/// weights ignore that, the covariance does not (NoiseCorrelation). If W is the inverse variance but the residual
/// is clearly larger than it predicts, the covariance is raised by that ratio (`residual_scale`). Empty if numerators
/// are not determined; entries of a channel without weight are NaN.
/// To save memory, the equations are computed per part of the channels, once for the globals and once for the rest.
/// @param groups evaluated with derivatives at the estimate   @param cost there
/// @param frozen globals that are not unknowns (a mode at its bound): considered exactly known
ParameterCovariance parameter_covariance(const FitProblem& problem, const FitParameters& beta,
                                         const std::vector<BasisGroup>& groups, double cost,
                                         const DataNoise& noise,
                                         const std::vector<Eigen::Index>& frozen,
                                         WantedCovariance wanted);

/// The same for weight matrices that are the inverse covariance of the noise (`knowledge` weights, then
/// multiplied by WeightMatrices::scatter_factor()) or proportional to it (none):
///   Cov(globals) = 1/2 [(sum Re{J^H W J})^-1]_aa, its columns by conjugate gradients.
///
/// Response: dP_c = (J_a - F Z) d a + F nu_c, with nu, the numerators' own part, independent of d a. The first part is
/// exact. Cov(nu_c) is that of a fit to the channel alone, weighted by its own variance. It is never smaller than the
/// true one (Gauss-Markov). It is equal if the correlation of the noise is real and the same on all lines, because all
/// channels have the same functions F (Zellner, J. Am. Stat. Assoc. 57 (1962) 348). Otherwise the band is too wide,
/// never too narrow; the exact one would need a solution per numerator. The same holds for the variances of the
/// numerators.
ParameterCovariance joint_covariance(const FitProblem& problem, const FitParameters& beta,
                                     const std::vector<BasisGroup>& groups, double cost,
                                     const JointEquations& equations, VarianceKnowledge knowledge,
                                     double scatter_factor, const std::vector<Eigen::Index>& frozen,
                                     bool with_response);

/// Standard deviations of natural frequencies, damping ratios, other poles, delays and numerators of the model, from
/// the covariance of the parameters by the delta method:
///   df = -f/2 da_2/a_2,  dzeta = zeta (da_1/a_1 - da_2/(2 a_2)).
/// A parameter at a bound has none.
void fill_deviations(const FitProblem& problem, const ParameterCovariance& covariance,
                     AdditiveModel& model);

// Parts that are also used for fits with other structures.

/// S^-1 on the free parameters, zero for frozen ones.
Eigen::MatrixXd free_inverse(const Eigen::MatrixXd& S, const std::vector<Eigen::Index>& frozen);

/// Diagonal of X C Y^T, real and imaginary parts summed.
Eigen::VectorXd quadratic(const SplitMatrix& X, const Eigen::MatrixXd& C, const SplitMatrix& Y);

}  // namespace stageid
