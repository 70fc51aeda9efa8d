#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/joint_equations.hpp"
#include "estimation/products/channel_equations.hpp"
#include "estimation/uncertainty/data_noise.hpp"

namespace stageid {

/// What is known of one channel's numerators b_c = nu_c - Z a: of their own part nu, and how it goes with
/// the globals a.
struct ChannelCovariance {
  Eigen::MatrixXd own;                ///< Cov(nu_c)
  Eigen::MatrixXd cross;              ///< Cov(a, nu_c)
  Eigen::MatrixXd Z;                  ///< the channel's rows of M_bb^-1 M_ba
  Eigen::MatrixXd equations_inverse;  ///< the channel's block of M_bb^-1
};

struct ParameterCovariance {
  Eigen::MatrixXd globals;             ///< of denominator coefficients and delays
  Eigen::MatrixXd numerator_variance;  ///< of B, n_c x n_f
  Eigen::MatrixXd response_variance;   ///< E|dP|^2, n_c x N; empty if not asked for
  double residual_scale = 1.0;      ///< what variances were multiplied with (unknown or too small)
  Eigen::MatrixXd globals_inverse;  ///< (M^-1)_aa
  std::vector<ChannelCovariance> channels;  ///< if they are wanted
};

/// What of a ParameterCovariance beside the deviations is wanted.
struct WantedCovariance {
  bool response = false;  ///< as large as the data
  bool channels = false;  ///< so that numerators of different channels can be put together
};

/// First-order covariance of the estimate. With M = sum Re{J^H W J} and K = sum Re{J^H W C W J},
///   Cov(beta) = 1/2 M^-1 K M^-1,   which is [2 sum Re{J^H C^-1 J}]^-1 for W = C^-1
/// (facts.md section 10), restricted to what is wanted by the arrow structure: with Z the channel's rows
/// of M_bb^-1 M_ba and nu what its numerators would be for given globals a,
///   b_c = nu_c - Z a,   dP_c = (J_a - F Z) a + F nu_c.
/// The outputs' noise is correlated wherever a disturbance force causes it, that of inputs wherever the
/// controller answers; diagonal weights ignore that, the covariance does not (noise_correlation.hpp).
/// Where W is the inverse variance but the residual is clearly larger than it predicts, the covariance is
/// raised by that ratio (`residual_scale`). Empty where numerators are not determined; what belongs to a
/// channel without weight is NaN.
/// The equations are made in parts of channels, once for the globals and once for the rest: memory is
/// that of a part.
/// @param groups evaluated with derivatives at the estimate   @param cost there
/// @param frozen globals that are not unknowns (a mode at its bound): known exactly here
ParameterCovariance parameter_covariance(const FitProblem& problem, const FitParameters& beta,
                                         const std::vector<BasisGroup>& groups, double cost,
                                         const DataNoise& noise,
                                         const std::vector<Eigen::Index>& frozen,
                                         WantedCovariance wanted);

/// The same for weight matrices that are the noise's inverse covariance (`knowledge` weights, then
/// multiplied by WeightMatrices::scatter_factor()) or proportional to it (none):
///   Cov(globals) = 1/2 [(sum Re{J^H W J})^-1]_aa, its columns by conjugate gradients.
///
/// Response: dP_c = (J_a - F Z) d a + F nu_c, where nu, the numerators' own part, does not depend on
/// d a. The first part is exact. Cov(nu_c) is that of a fit to the channel alone, weighed by its own
/// variance: never smaller than the true one (Gauss-Markov), and equal to it where the correlation of
/// the noise is real and the same on all lines, because every channel has the same functions F
/// (Zellner, J. Am. Stat. Assoc. 57 (1962) 348). The band is right there and too wide elsewhere, never
/// too narrow; the exact one would take a solution for every numerator. The same holds for the
/// numerators' variances.
ParameterCovariance joint_covariance(const FitProblem& problem, const FitParameters& beta,
                                     const std::vector<BasisGroup>& groups, double cost,
                                     const JointEquations& equations, VarianceKnowledge knowledge,
                                     double scatter_factor, const std::vector<Eigen::Index>& frozen,
                                     bool with_response);

// Parts of it that fits of another structure use too.

/// A channel's group, one entry a channel.
std::vector<const BasisGroup*> groups_of_channels(const FitProblem& problem,
                                                  const std::vector<BasisGroup>& groups);

/// S^-1 on the free parameters, zero where one is frozen.
Eigen::MatrixXd free_inverse(const Eigen::MatrixXd& S, const std::vector<Eigen::Index>& frozen);

/// Diagonal of X C Y^T, real and imaginary parts summed.
Eigen::VectorXd quadratic(const Eigen::MatrixXd& X_re, const Eigen::MatrixXd& X_im,
                          const Eigen::MatrixXd& C, const Eigen::MatrixXd& Y_re,
                          const Eigen::MatrixXd& Y_im);

}  // namespace stageid
