#pragma once

#include <optional>
#include <vector>

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Bounds of the poles of a fit.
///
/// A pole far below or above the lines appears only as a slope or a constant. The data do not determine its
/// frequency, which would drift; it is held at the bound and not counted as an unknown.
class ParameterBounds {
 public:
  /// Natural frequencies from a quarter of the lowest line (or that of the lowest mode of the start) to ten times the
  /// highest line, or nearly Nyquist with the exact hold; damping ratios in [1e-5, 0.9]. Poles of requested submodels
  /// (SubmodelRole) may be as low as 1/300 of the lowest line, and real poles are not bounded by Nyquist.
  ParameterBounds(const FitProblem& problem, const FitParameters& start);

  /// Moves all poles of `beta` into their bounds, a mode at most a third away from `before`; unstable poles of a start are
  /// reflected.
  /// @returns false if coefficients have no poles
  bool stabilize(const FitParameters& before, FitParameters& beta) const;

  /// The denominator coefficients at a bound that a lower cost (`descent`, minus its gradient) would push further, for
  /// modes and real poles, and FitProblem::held. For submodels with three or more poles, a pole at its bound does not
  /// correspond to one coefficient, so it is not included: such a fit ends without converging.
  std::vector<Eigen::Index> leaning(const FitParameters& beta,
                                    const Eigen::VectorXd& descent) const;

  /// A direct term answers to a held input at once, so the response jumps where a delay passes a whole number of samples.
  /// Tries a step, and if it fails, the same with delays that stop beside the first jump, where they are held from then
  /// on.
  /// @param step of the globals, then of others; @param lowers_cost of a step, which it takes in that case
  template <typename LowersCost>
  bool try_to_jump(const FitProblem& problem, const FitParameters& here, Eigen::VectorXd step,
                   const LowersCost& lowers_cost) {
    if (lowers_cost(step)) return true;
    const std::vector<Eigen::Index> stopped = stop_at_jump(problem, here, step);
    if (stopped.empty() || !lowers_cost(step)) return false;
    held_delays_.insert(held_delays_.end(), stopped.begin(), stopped.end());
    return true;
  }

  /// The step of the globals to the other side of the nearest jump, if there is one delay for all channels.
  std::optional<Eigen::VectorXd> step_over_jump(const FitProblem& problem,
                                                const FitParameters& here) const;

  /// Without the delays held at a jump, whose deviations are those of free parameters.
  void drop_delays(std::vector<Eigen::Index>& frozen) const;

  /// True if a pole of submodel `i` is at a bound.
  bool at_bound(std::size_t i, const Eigen::VectorXd& a) const;

 private:
  /// @returns the delays of the channels that would have passed the first jump
  std::vector<Eigen::Index> stop_at_jump(const FitProblem& problem, const FitParameters& here,
                                         Eigen::VectorXd& step) const;
  void stabilize_mode(std::size_t i, const Eigen::VectorXd& before, Eigen::VectorXd& a) const;
  bool stabilize_poles(std::size_t i, Eigen::VectorXd& a) const;
  std::complex<double> contained(std::size_t i, std::complex<double> pole) const;

  std::vector<double> lowest_rad_s_;  // per submodel
  std::vector<bool> slow_damping_;    // suspensions: their damping must not increase too early
  double highest_rad_s_ = 0.0;
  double highest_real_rad_s_ = 0.0;
  std::vector<Eigen::Index> held_;
  std::vector<Eigen::Index> held_delays_;
};

}  // namespace stageid
