#pragma once

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// 95 % quantile of |z| / sqrt(E|z|^2) of a complex Gaussian z of mean zero;
/// `relation` = |E z^2| / E|z|^2: 1.731 for 0 (circular), 1.960 for 1 (on a line).
///   P(|z| > r) = 2/pi int_0^{pi/2} exp(-r^2 / ((1 + rho) cos^2 t + (1 - rho) sin^2 t)) dt,  E|z|^2 = 1
double error_quantile_95(double relation);

/// FitCovariance::response_variance and response_radius from the covariance of the parameters. Errors of a model are
/// not circular: few parameters move P along few directions.
void fill_response_errors(const FitProblem& problem, const FitParameters& beta,
                          const std::vector<BasisGroup>& groups, FitCovariance& covariance);

}  // namespace stageid
