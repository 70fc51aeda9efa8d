#pragma once

#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Of a requested number of modes, some may be hidden by noise: their poles move to the largest noise peaks and do not
/// converge. Holds the poles of the hidden modes of `fit` at their current values, and frees those of the others.
///
/// The noise is what the residual scatters from line to line. A mode is hidden if noise alone would reach its removal
/// cost on more than one of the lines. @param weights of the fit, n_c x N
/// @returns the number of hidden modes
int hold_hidden_modes(const FrfEstimate& frf, const Eigen::MatrixXd& weights, int threads,
                      FitResult& fit);

/// Shrinks the numerators of hidden modes towards zero, since they are mostly noise that their poles have selected. Of
/// the d numbers b of a mode with covariance C, the share s = (d - 2) / (2 b' C^-1 b) is removed, limited to nearly
/// all. The other numerators adapt such that sum W |E|^2 + sigma^2 sum_i s/(1 - s) b_i' C_i^-1 b_i is minimal, with
/// sigma^2 from the residual. For one mode, the expected squared error falls for every truth; twice the share would be
/// best, but would raise the cost four times as much.
/// Source: James and Stein, Fourth Berkeley Symposium 1 (1961) 361.
/// @param hidden submodels  @param removal removal_costs() of B @pre `B` solves the convex problem, with that cost
/// @param[in,out] B n_c x n_f  @param[in,out] cost 1/(2N) sum W |E|^2
void shrink_hidden_modes(const FitProblem& problem, const BasisGroups& groups,
                         const std::vector<std::size_t>& hidden, const std::vector<double>& removal,
                         Eigen::MatrixXd& B, double& cost);

}  // namespace stageid
