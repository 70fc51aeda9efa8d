#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimation/uncertainty/noise_correlation.hpp"

namespace stageid {

/// Knowledge of the variance of the data.
enum class VarianceKnowledge : std::uint8_t {
  weights,  ///< W is its inverse, known or estimated: maximum likelihood
  given,    ///< another variance than that of the weights: sandwich form
  none      ///< proportional to 1/W, scaled by the residual
};

/// The noise of the data, as far as known.
struct DataNoise {
  VarianceKnowledge knowledge = VarianceKnowledge::none;
  std::optional<LineVariance> variance;  ///< none: 1/W, up to a scale with `none`
  NoiseCorrelation correlation;          ///< of channels on a line
};

/// The noise of the data under diagonal weights. A given variance is not smoothed: the covariance is linear in it, and
/// smoothing would only lower its peaks. The total variance is used if there is one, because nonlinear distortion
/// changes an estimate from realization to realization as noise does. `frf` must outlive the result.
DataNoise data_noise(const FrfEstimate& frf, Weighting weighting);

/// Number of independent real numbers of the response.
double independent_numbers(const FrfEstimate& frf);

/// True if the weighting is defined as the inverse covariance of the noise.
bool weighs_by_variance(Weighting weighting) noexcept;

/// Whether the weight of a channel is zero on all lines, so that the data do not determine it.
bool has_no_weight(const FitProblem& problem, Eigen::Index channel);

/// sum W |E|^2 per complex degree of freedom; 1 if W is the inverse variance and the model is right.
double residual_per_degree(const FitProblem& problem, double cost, Eigen::Index parameters);

/// Factor of the variances: 1 if the weights are inverse variances (`likelihood`) and the residual is not clearly
/// larger than predicted, else the residual per degree of freedom.
double residual_scale(double per_degree, bool likelihood);

/// That factor for the given noise: 1 if its variance is given separately from the weights.
double covariance_scale(const FitProblem& problem, double cost, Eigen::Index parameters,
                        const DataNoise& noise);

/// The problem whose Gauss-Newton matrix is K for uncorrelated noise, with weights W C W.
/// @pre noise.variance is known
FitProblem middle_problem(const FitProblem& problem, const DataNoise& noise);

/// Columns of one channel on some lines, times W C^1/2; for correlated_gram().
SplitMatrix noise_scaled(const FitProblem& problem, const DataNoise& noise, Eigen::Index c,
                         IndexRange lines, SplitMatrix columns);

}  // namespace stageid
