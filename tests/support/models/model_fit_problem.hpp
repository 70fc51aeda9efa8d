#pragma once

#include "estimation/problem/fit_problem.hpp"
#include "tests/support/models/model_dense_step.hpp"

namespace stageid::test {

/// Named channels "a1".. and "z1".., no submodels yet.
AdditiveModel named_model(int outputs, int inputs);

/// A submodel with the given denominator and zero numerators of `matrices` powers of s.
Submodel empty_submodel(const AdditiveModel& model, int integrators, std::vector<double> a,
                        int matrices);

/// A dense problem as the library's equations take it.
FitProblem fit_problem(const DenseProblem& problem, DelayModel delay);

/// All of a variance that there is, n_c x N.
Eigen::MatrixXd values(const std::optional<LineVariance>& variance);
FitParameters fit_parameters(const DenseProblem& problem);

/// The FRF of a dense problem, without variances.
FrfEstimate frf_of(const DenseProblem& problem);

}  // namespace stageid::test
