#pragma once

#include "estimation/problem/fit_problem.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"

namespace stageid {

/// Standard deviations of natural frequencies, damping ratios, other poles, delays and numerators of the model, from
/// the covariance of the parameters by the delta method:
///   df = -f/2 da_2/a_2,  dzeta = zeta (da_1/a_1 - da_2/(2 a_2)).
/// A parameter at a bound has none.
void fill_deviations(const FitProblem& problem, const ParameterCovariance& covariance,
                     AdditiveModel& model);

}  // namespace stageid
