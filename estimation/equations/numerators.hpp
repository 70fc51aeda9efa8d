#pragma once

#include <optional>
#include <vector>

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// What solve_numerators() finds besides them.
struct SolvedNumerators {
  double cost = 0.0;
  bool factored = false;  ///< some were computed by factors, as sums have too few digits
};

/// Solves the convex problem, numerators for fixed denominators, per channel, by normal equations scaled to unit
/// diagonal and one step of refinement; by orthogonal factors where the refinement shows that products have too few
/// digits, as for nearly exact data or modes that cancel each other. `B` is overwritten; each process of a team solves
/// the rows of its own channels, see gather_numerators().
/// @returns nothing if the equations of a channel are singular to rounding
std::optional<SolvedNumerators> solve_numerators(const FitProblem& problem,
                                                 const BasisGroups& groups, Eigen::MatrixXd& B);

/// Gives the numerators of each process to all others.
void gather_numerators(const FitProblem& problem, Eigen::MatrixXd& B);

/// Rise of sum W |E|^2 if the numerators of a submodel were removed and the others re-solved; one entry per submodel.
/// @pre `B` solves the convex problem.
std::vector<double> removal_costs(const FitProblem& problem, const BasisGroups& groups,
                                  const Eigen::MatrixXd& B);

/// Numerators that minimize sum W |E|^2 + sum_i s_i / (1 - s_i) b_i' C_i^-1 b_i: alone, submodel i would keep 1 - s_i
/// of its numerators b_i. C_i is the block of the inverse normal equations.
/// @param share s, 0 <= s < 1; one entry per submodel  @pre `B` solves the convex problem
/// @returns the rise of sum W |E|^2
double shrink_numerators(const FitProblem& problem, const BasisGroups& groups,
                         const std::vector<double>& share, Eigen::MatrixXd& B);

}  // namespace stageid
