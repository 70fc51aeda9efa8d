#pragma once

#include <vector>

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Bounds of the poles of a fit.
///
/// A pole far below or above the lines appears only as a slope or a constant. The data do not determine its
/// frequency, which would drift; it is held at the bound and not counted as an unknown.
class PoleBounds {
 public:
  /// Natural frequencies from a quarter of the lowest line (or that of the lowest mode of the start) to ten times the
  /// highest line, or nearly Nyquist with the exact hold; damping ratios in [1e-5, 0.9]. Poles of requested submodels
  /// (SubmodelRole) may be as low as 1/300 of the lowest line, and real poles are not bounded by Nyquist.
  PoleBounds(const FitProblem& problem, const FitParameters& start);

  /// Moves all poles of `beta` into their bounds, a mode at most a third away from `before`; unstable poles of a start are
  /// reflected.
  /// @returns false if coefficients have no poles
  bool stabilize(const FitParameters& before, FitParameters& beta) const;

  /// The denominator coefficients at a bound that a lower cost (`descent`, minus its gradient) would push further, for
  /// modes and real poles, and FitProblem::held. For submodels with three or more poles, a pole at its bound does not
  /// correspond to one coefficient, so it is not included: such a fit ends without converging.
  std::vector<Eigen::Index> leaning(const FitParameters& beta,
                                    const Eigen::VectorXd& descent) const;

  /// True if a pole of submodel `i` is at a bound.
  bool at_bound(std::size_t i, const Eigen::VectorXd& a) const;

 private:
  void stabilize_mode(std::size_t i, const Eigen::VectorXd& before, Eigen::VectorXd& a) const;
  bool stabilize_poles(std::size_t i, Eigen::VectorXd& a) const;
  std::complex<double> contained(std::size_t i, std::complex<double> pole) const;

  std::vector<double> lowest_rad_s_;  // per submodel
  std::vector<bool> slow_damping_;    // suspensions: their damping must not increase too early
  double highest_rad_s_ = 0.0;
  double highest_real_rad_s_ = 0.0;
  std::vector<Eigen::Index> held_;
};

}  // namespace stageid
