#pragma once

#include "estimation/problem/fit_options.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "tests/support/models/model_dense_step.hpp"
#include "tests/support/models/model_reference.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {

/// Named channels "a1".. and "z1".., no submodels yet.
AdditiveModel named_model(int outputs, int inputs);

/// A submodel with the given denominator and zero numerators of `matrices` powers of s.
Submodel empty_submodel(const AdditiveModel& model, int integrators, std::vector<double> a,
                        int matrices);

/// The same of a mode.
Submodel empty_mode(const AdditiveModel& model, double frequency_hz, double damping_ratio,
                    int matrices = 1);

/// Sets G of the problem to the reference response of its model.
void measure(DenseProblem& problem);

/// A dense problem as the library's equations take it.
FitProblem fit_problem(const DenseProblem& problem, DelayModel delay);

/// All of a variance that there is, n_c x N.
Eigen::MatrixXd values(const std::optional<LineVariance>& variance);
FitParameters fit_parameters(const DenseProblem& problem);

/// The FRF of a dense problem, without variances.
FrfEstimate frf_of(const DenseProblem& problem);

/// Adds noise of the FRF's noise variance.
void add_noise(FrfEstimate& frf, RandomNumbers& random);

/// Adds circular noise of a standard deviation relative to each value.
void add_relative_noise(Eigen::MatrixXcd& response, double relative, RandomNumbers& random);

FitOptions fit_options(Weighting weighting, HoldModel hold = HoldModel::none,
                       DelayModel delay = DelayModel::fixed, double delay_s = 0.0);

}  // namespace stageid::test
