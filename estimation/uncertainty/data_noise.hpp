#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimation/uncertainty/noise_correlation.hpp"

namespace stageid {

/// What is known about the data's variance.
enum class VarianceKnowledge : std::uint8_t {
  weights,  ///< W is its inverse, exactly or as far as it was estimated: maximum likelihood
  given,    ///< another variance than the weights': sandwich form
  none      ///< proportional to 1/W, scaled by the residual
};

/// The noise of the data as far as it is known.
struct DataNoise {
  VarianceKnowledge knowledge = VarianceKnowledge::none;
  std::optional<LineVariance> variance;  ///< nothing: 1/W, up to a scale with `none`
  NoiseCorrelation correlation;          ///< of channels on a line
};

/// What is known of the noise under diagonal weights. The given variance is taken as it is: the
/// covariance is linear in it, and smoothing would only lower its peaks. Nonlinear distortion moves
/// an estimate from realization to realization as noise does: the total variance counts where there
/// is one. `frf` must outlive the result.
DataNoise data_noise(const FrfEstimate& frf, Weighting weighting);

/// Real numbers of the response, as many as are independent.
double independent_numbers(const FrfEstimate& frf);

/// True if the weights claim to be the inverse of the noise's covariance.
bool weighs_by_variance(Weighting weighting) noexcept;

/// Whether a channel's weight is zero on all lines: the data say nothing of it.
bool has_no_weight(const FitProblem& problem, Eigen::Index channel);

/// sum W |E|^2 per complex degree of freedom: 1 where W is the inverse variance and the model right.
double residual_per_degree(const FitProblem& problem, double cost, Eigen::Index parameters);

/// What variances are multiplied with: 1 where the weights are inverse variances (`likelihood`) and the
/// residual is not clearly larger than they predict, else the residual per degree of freedom.
double residual_scale(double per_degree, bool likelihood);

/// That scale for what is known of the noise: 1 where the variance is given apart from the weights.
double covariance_scale(const FitProblem& problem, double cost, Eigen::Index parameters,
                        const DataNoise& noise);

/// The problem whose Gauss-Newton matrix is K for uncorrelated noise: weights W C W.
/// @pre noise.variance is known
FitProblem middle_problem(const FitProblem& problem, const DataNoise& noise);

/// W C^1/2 of one channel on some lines, for correlated_gram().
Eigen::ArrayXd noise_scale(const FitProblem& problem, const DataNoise& noise, Eigen::Index c,
                           LineRange lines);

}  // namespace stageid
