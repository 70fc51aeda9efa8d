#pragma once

#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Of very many modes that are asked for the data show some not at all: their poles settle on the largest
/// noise peaks and never come to rest. Holds the poles of those modes of `fit` that noise hides where they are.
///
/// Noise is what the residual shows. A mode is hidden if noise alone would reach its removal cost on more than
/// one of the lines. @param channels outputs times inputs @param lines of the fit
/// @returns how many are hidden
int hold_hidden_modes(const FitResult& fit, Eigen::Index channels, Eigen::Index lines,
                      AdditiveModel& model);

/// Numerators of hidden modes are shrunk towards zero, since most of them is noise that their poles have found: of
/// a mode's d numbers b with covariance C the share s = (d - 2) / (2 b' C^-1 b), at most nearly all. The others
/// follow: sum W |E|^2 + sigma^2 sum_i s/(1 - s) b_i' C_i^-1 b_i is least, sigma^2 from the residual. For one mode
/// the expected squared error falls whatever the truth is; twice the share is best for it and costs four times as
/// much of the cost.
/// Source: James and Stein, Fourth Berkeley Symposium 1 (1961) 361.
/// @param hidden submodels  @param removal removal_costs() of B @pre `B` solves the convex problem, with that cost
/// @param[in,out] B n_c x n_f  @param[in,out] cost 1/(2N) sum W |E|^2
void shrink_hidden_modes(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                         const std::vector<std::size_t>& hidden, const std::vector<double>& removal,
                         Eigen::MatrixXd& B, double& cost);

}  // namespace stageid
