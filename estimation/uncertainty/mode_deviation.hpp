#pragma once

#include "estimation/problem/fit_problem.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"

namespace stageid {

/// Standard deviations of the model's natural frequencies, damping ratios, other poles, delays and numerators, from the
/// covariance of the parameters. Delta method:
///   df = -f/2 da_2/a_2,  dzeta = zeta (da_1/a_1 - da_2/(2 a_2)).
/// A parameter at a bound has none.
void fill_deviations(const FitProblem& problem, const ParameterCovariance& covariance,
                     AdditiveModel& model);

}  // namespace stageid
