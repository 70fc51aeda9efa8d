#pragma once

#include <vector>

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Checks that the FRF, the submodels, hold and options of a fit are consistent.
/// @throws std::invalid_argument naming the first that is not
void check_start(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options);

/// The data and the shapes, roles and held frequencies of the submodels, with diagonal weights W, n_c x N.
/// `frf` must outlive the problem, which refers to its response.
/// @throws std::invalid_argument: more parameters than data
FitProblem make_problem(const FrfEstimate& frf, const AdditiveModel& start,
                        const FitOptions& options, SharedMatrix<Eigen::MatrixXd> W);

/// The values of the start; estimated delays start from its delays if it has any.
FitParameters make_parameters(const FitProblem& problem, const AdditiveModel& start,
                              const FitOptions& options);

/// Removes the coefficients of poles that are held at a guess (HeldPole::guess) from globals of a fit of this model.
void drop_guesses(const AdditiveModel& model, std::vector<Eigen::Index>& globals);

/// Writes denominators, numerators and delays into a model with the structure of the problem.
void fill_submodels(const FitProblem& problem, const FitParameters& beta, AdditiveModel& model);

}  // namespace stageid
