#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// All ranges together may have as many numbers as one with this many rows.
constexpr Eigen::Index kMostParameters = 4000;

/// Whether the ranges of every submodel, or of all functions together, have no more.
bool have_affordable_covariances(const FitProblem& problem, const AdditiveModel& model);

/// The covariances whose diagonals parameter_covariance() and related functions compute, including those between
/// channels; one per range. Each is of all globals (denominator coefficients in the order of the submodels, then free
/// delays), followed by the numerators of the functions in the range, vec of channels x functions, without response
/// parts. The sandwich is 1/2 M^-1 K M^-1, the likelihood 1/2 M^-1 = [2 sum Re{J^H W J}]^-1. With weight matrices they
/// are exact: M is formed and inverted.
/// @param result of fit_additive_model() with these data and options
/// @returns empty if the fit has no standard deviations, or the ranges exceed kMostParameters
std::vector<FitCovariance> dense_covariances(const FrfEstimate& frf, const FitResult& result,
                                             const FitOptions& options,
                                             const std::vector<DataRange>& ranges);

/// Fills FitResult::covariance, or adds a decision with the reason why there is none.
void fill_covariance(const FrfEstimate& frf, const FitOptions& options, FitResult& result);

/// 95 % quantile of |z| / sqrt(E|z|^2) of a complex Gaussian z of mean zero;
/// `relation` = |E z^2| / E|z|^2: 1.731 for 0 (circular), 1.960 for 1 (on a line).
///   P(|z| > r) = 2/pi int_0^{pi/2} exp(-r^2 / ((1 + rho) cos^2 t + (1 - rho) sin^2 t)) dt,  E|z|^2 = 1
double error_quantile_95(double relation);

/// The radius of the disc around a complex value with Gaussian error that contains it with probability 0.95, within
/// 1e-5, from the variances of its real and imaginary part and their covariance; NaN: unknown.
double disc_radius_95(double real, double imaginary, double between);

/// The functions of every submodel among those of a channel.
std::vector<DataRange> functions_of_submodels(const AdditiveModel& model);

}  // namespace stageid
