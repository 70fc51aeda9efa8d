#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "estimation/products/pair_grams.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Covariance of all globals (denominator coefficients in the order of the submodels, then free delays), followed by
/// the numerators of some functions, vec of channels x functions.
struct DenseCovariance {
  /// Of the estimate, 1/2 M^-1 K M^-1 (see parameter_covariance()); the standard deviations are from this one.
  Eigen::MatrixXd sandwich;
  /// 1/2 M^-1 = [2 sum Re{J^H W J}]^-1: the covariance if W were the inverse covariance of the noise.
  Eigen::MatrixXd likelihood;
};

/// All sets together may have as many numbers as one set with this many rows.
constexpr Eigen::Index kMostParameters = 4000;

/// The covariances whose diagonals parameter_covariance() and related functions compute, including those between
/// channels; one per set. With weight matrices they are exact: M is formed and inverted.
/// @param result of fit_additive_model() with these data and options
/// @returns empty if the fit has no standard deviations, or the sets exceed kMostParameters
std::vector<DenseCovariance> dense_covariances(const FrfEstimate& frf, const FitResult& result,
                                               const FitOptions& options,
                                               const std::vector<FunctionSet>& sets);

/// Fills FitResult::covariance, or adds a decision with the reason why there is none.
void fill_covariance(const FrfEstimate& frf, const FitOptions& options, FitResult& result);

/// The functions of submodel i: their indices among those of a channel.
FunctionSet functions_of(const AdditiveModel& model, std::size_t submodel);
FunctionSet all_functions(const AdditiveModel& model);

}  // namespace stageid
