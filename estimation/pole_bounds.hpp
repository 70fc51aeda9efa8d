#pragma once

#include <vector>

#include "estimation/fit_problem.hpp"

namespace stageid {

/// Where the poles of a fit may go.
///
/// A mode far below or above the lines is seen only as a slope or a constant: its frequency is not in the
/// data and would wander off. It is held at the bound, and then no longer counted among the unknowns.
class PoleBounds {
 public:
  /// Natural frequencies from a quarter of the lowest line (or that of the lowest mode of the start) to ten
  /// times the highest line, or nearly Nyquist with the exact hold; damping ratios in [1e-5, 0.9].
  PoleBounds(const FitProblem& problem, const FitParameters& start);

  /// Reflects and clips the modes of `beta`. @returns false if it is not acceptable: an unstable submodel of
  /// another order, or a mode that moved by more than a third since `before`.
  bool stabilize(const FitParameters& before, FitParameters& beta) const;

  /// The denominator coefficients of modes that lean on a bound and that a lower cost (`descent`,
  /// minus its gradient) would push further.
  std::vector<Eigen::Index> leaning(const FitParameters& beta,
                                    const Eigen::VectorXd& descent) const;

 private:
  bool stabilize_mode(const Eigen::VectorXd& before, Eigen::VectorXd& a) const;

  double lowest_rad_s_ = 0.0;
  double highest_rad_s_ = 0.0;
};

}  // namespace stageid
