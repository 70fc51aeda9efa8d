#pragma once

#include <vector>

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Where the poles of a fit may go.
///
/// A pole far below or above the lines is seen only as a slope or a constant: its frequency is not in the
/// data and would wander off. It is held at the bound, and then no longer counted among the unknowns.
class PoleBounds {
 public:
  /// Natural frequencies from a quarter of the lowest line (or that of the lowest mode of the start) to ten
  /// times the highest line, or nearly Nyquist with the exact hold; damping ratios in [1e-5, 0.9].
  /// Poles of submodels that were asked for (SubmodelRole) may go to 1/300 of the lowest line, and
  /// real poles are not bounded by Nyquist.
  PoleBounds(const FitProblem& problem, const FitParameters& start);

  /// Moves all poles of `beta` to where they may be; unstable ones of a start are reflected.
  /// @returns false if it is not acceptable: a mode that moved by more than a third since `before`,
  /// or coefficients without poles.
  bool stabilize(const FitParameters& before, FitParameters& beta) const;

  /// The denominator coefficients of modes and real poles that lean on a bound and that a lower cost
  /// (`descent`, minus its gradient) would push further, and FitProblem::held. A pole of a
  /// submodel with three or more at its bound is no coefficient and is not among them: there a fit
  /// that leans on it ends without converging.
  std::vector<Eigen::Index> leaning(const FitParameters& beta,
                                    const Eigen::VectorXd& descent) const;

  /// True if a pole of submodel `i` stands at a bound.
  bool at_bound(std::size_t i, const Eigen::VectorXd& a) const;

 private:
  bool stabilize_mode(std::size_t i, const Eigen::VectorXd& before, Eigen::VectorXd& a) const;
  bool stabilize_poles(std::size_t i, Eigen::VectorXd& a) const;
  std::complex<double> contained(std::size_t i, std::complex<double> pole) const;

  std::vector<double> lowest_rad_s_;  // of every submodel
  std::vector<bool> slow_damping_;    // suspensions: their damping may not run ahead
  double highest_rad_s_ = 0.0;
  double highest_real_rad_s_ = 0.0;
  std::vector<Eigen::Index> held_;
};

}  // namespace stageid
