#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/products/weighted_products.hpp"

namespace stageid {

/// The equations of a Gauss-Newton step by orthogonal factors. Sums of products lose half the digits; that matters once
/// the residual is smaller than what they lose. Takes several times longer than ArrowSystem, with many channels up to a
/// hundred times: no products are shared between them.
///
/// Per channel, sqrt(W) [F, dP/dglobals, G] = Q R. The rows of R below those of F are the equations of the globals after
/// elimination of the numerators; those of all channels together have the triangle [R, r], and the step minimizes
/// |R step - r|.
class FactoredEquations {
 public:
  /// @pre `groups` were evaluated with derivatives at `beta`, whose numerators are solved and gathered.
  FactoredEquations(const FitProblem& problem, const FitParameters& beta,
                    const std::vector<BasisGroup>& groups);

  /// As those of ArrowSystem for gn.
  Eigen::VectorXd solve_globals(double damping, const std::vector<Eigen::Index>& frozen) const;
  const Eigen::MatrixXd& schur() const noexcept { return schur_; }
  const Eigen::VectorXd& schur_gradient() const noexcept { return schur_e_; }

 private:
  Eigen::MatrixXd R_;
  Eigen::VectorXd r_;
  Eigen::MatrixXd schur_;
  Eigen::VectorXd schur_e_;
};

/// Counts the work of factored_numerators() for so many channels.
void add_work_of_factors(const FitProblem& problem, double channels);

/// Numerators of a block of channels, members x n_f, and their sum W |E|^2, by orthogonal factors.
/// @returns false if the functions of a channel depend on each other to rounding
bool factored_numerators(const FitProblem& problem, const BasisGroup& group, const TileRange& block,
                         Eigen::MatrixXd& B, double& squares);

}  // namespace stageid
