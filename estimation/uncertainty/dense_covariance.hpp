#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "estimation/products/pair_grams.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Covariance of all globals (denominator coefficients in the order of the submodels, then free delays)
/// and of the numerators of some functions behind them, vec of channels x functions.
struct DenseCovariance {
  /// Of the estimate, 1/2 M^-1 K M^-1 (see parameter_covariance()): the standard deviations are its own.
  Eigen::MatrixXd sandwich;
  /// 1/2 M^-1 = [2 sum Re{J^H W J}]^-1: what it were if W was the noise's inverse covariance.
  Eigen::MatrixXd likelihood;
};

/// All sets together may have as many numbers as one with so many rows.
constexpr Eigen::Index kMostParameters = 4000;

/// The covariances that parameter_covariance() and the like tell the diagonals of, with all that is between
/// channels, an entry a set. Under weight matrices they are exact: M is made and inverted there.
/// @param result of fit_additive_model() with these data and options
/// @returns nothing where the fit has no standard deviations, or the sets are above kMostParameters
std::vector<DenseCovariance> dense_covariances(const FrfEstimate& frf, const FitResult& result,
                                               const FitOptions& options,
                                               const std::vector<FunctionSet>& sets);

/// FitResult::covariance, or a decision why there is none.
void fill_covariance(const FrfEstimate& frf, const FitOptions& options, FitResult& result);

/// Names the functions of submodel i: their places in a channel.
FunctionSet functions_of(const AdditiveModel& model, std::size_t submodel);
FunctionSet all_functions(const AdditiveModel& model);

}  // namespace stageid
