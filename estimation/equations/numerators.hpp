#pragma once

#include <vector>

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// The convex problem: numerators for fixed denominators, by channel, from normal equations scaled
/// to unit diagonal with one step of refinement. Also returns the cost. `B` is overwritten.
/// @returns false if a channel's equations are singular to rounding.
bool solve_numerators(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                      Eigen::MatrixXd& B, double& cost);

/// The same by orthogonal factors instead of normal equations, which lose half the digits: for data so
/// exact that the others matter. `B` and `cost` change only if the cost falls. Takes tens of times longer
/// where there are many functions.
void polish_numerators(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                       Eigen::MatrixXd& B, double& cost);

/// What sum W |E|^2 would rise by if a submodel's numerators were taken away and the others solved
/// again; one entry a submodel. @pre `B` solves the convex problem.
std::vector<double> removal_costs(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                                  const Eigen::MatrixXd& B);

/// Numerators of least sum W |E|^2 + sum_i s_i / (1 - s_i) b_i' C_i^-1 b_i: by itself submodel i would keep
/// 1 - s_i of its numerators b_i. C_i is the block of the inverse normal equations.
/// @param share s, 0 <= s < 1; one entry a submodel  @pre `B` solves the convex problem
/// @returns what sum W |E|^2 rises by
double shrink_numerators(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                         const std::vector<double>& share, Eigen::MatrixXd& B);

}  // namespace stageid
