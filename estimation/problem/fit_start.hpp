#pragma once

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// What a fit can begin with: the FRF, the submodels, hold and options fit together.
/// @throws std::invalid_argument naming what does not
void check_start(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options);

/// The data and the submodels' shapes, roles and held frequencies, with diagonal weights W, n_c x N.
/// `frf` must outlive the problem, which refers to its response.
/// @throws std::invalid_argument: more parameters than data
FitProblem make_problem(const FrfEstimate& frf, const AdditiveModel& start,
                        const FitOptions& options, SharedMatrix<Eigen::MatrixXd> W);

/// The start's values; delays from it where they are to be estimated and it has them.
FitParameters make_parameters(const FitProblem& problem, const AdditiveModel& start,
                              const FitOptions& options);

/// Writes denominators, numerators and delays into a model of the problem's structure.
void fill_submodels(const FitProblem& problem, const FitParameters& beta, AdditiveModel& model);

}  // namespace stageid
