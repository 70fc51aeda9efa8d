#pragma once

#include <vector>

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Solves the convex problem, numerators for fixed denominators, per channel, by normal equations scaled to unit
/// diagonal and one step of refinement. Also returns the cost. `B` is overwritten.
/// @returns false if the equations of a channel are singular to rounding.
bool solve_numerators(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                      Eigen::MatrixXd& B, double& cost);

/// The same by orthogonal factors instead of normal equations, which lose half the digits; for nearly exact data. `B`
/// and `cost` change only if the cost falls. Takes tens of times longer with many functions.
void polish_numerators(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                       Eigen::MatrixXd& B, double& cost);

/// Rise of sum W |E|^2 if the numerators of a submodel were removed and the others re-solved; one entry per submodel.
/// @pre `B` solves the convex problem.
std::vector<double> removal_costs(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                                  const Eigen::MatrixXd& B);

/// Numerators that minimize sum W |E|^2 + sum_i s_i / (1 - s_i) b_i' C_i^-1 b_i: alone, submodel i would keep 1 - s_i
/// of its numerators b_i. C_i is the block of the inverse normal equations.
/// @param share s, 0 <= s < 1; one entry per submodel  @pre `B` solves the convex problem
/// @returns the rise of sum W |E|^2
double shrink_numerators(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                         const std::vector<double>& share, Eigen::MatrixXd& B);

}  // namespace stageid
