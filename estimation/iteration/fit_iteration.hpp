#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "estimation/problem/fit_problem.hpp"
#include "estimation/problem/weight_matrices.hpp"

namespace stageid {

class ResidueFactors;

struct IterationResult {
  FitStatus status = FitStatus::iteration_limit;
  std::string message;
  std::vector<double> cost;  ///< the start (with solved numerators) first
  int iterations = 0;
  double deviations = HUGE_VAL;      ///< FitResult::deviations
  double gradient = 1.0;             ///< scaled, see FitOptions::gradient_tolerance
  double end_cost = 0.0;             ///< at the returned parameters
  std::vector<Eigen::Index> frozen;  ///< globals that ended at a bound and are not unknowns

  /// Counts a step to a lower cost.
  void accept(double lower, const FitOptions& options);
  /// @returns false: the iteration does not go on, here and below
  bool end(FitStatus why, std::string reason);
  /// With the distance from the first-order condition.
  bool end_here(FitStatus why, const std::string& what);
  /// The end if no step lowers the cost: at rounding level, or stalled.
  bool end_without_step();
};

/// Improves `beta` in place until the first-order condition holds: solve the numerators, step the denominators and
/// delays by the equations of the method, re-solve, accept only if the cost falls.
/// riv and gn: Levenberg-Marquardt damping; if the refined-IV step does not lower the cost, the Gauss-Newton step is
/// taken, which is a descent direction. sk: its own fixed point, undamped; the iterate of least cost is returned.
IterationResult iterate(const FitProblem& problem, FitParameters& beta, const FitOptions& options);

/// The same for Hermitian weights, starting from all of `beta` (a fit with the diagonal weights): Gauss-Newton on all
/// parameters at once, see JointEquations, damped until the cost falls. The cost is sum vec(E)^H W_k vec(E) / (2N).
/// @pre problem.W is weights.marginal().
IterationResult iterate(const FitProblem& problem, const WeightMatrices& weights,
                        FitParameters& beta, const FitOptions& options);

/// Minimizes the cost over numerators of given ranks (FitOptions::residue_rank and rigid_body_rank), starting from an
/// unconstrained fit `beta`, which is updated with its `factors`. Modes outside the lines represent several modes and
/// remain free.
/// Method: damped Gauss-Newton on denominators, delays and residue factors together. The unconstrained normal matrix
/// is multiplied by the derivatives of the factors from both sides, so an iteration costs as much as an unconstrained
/// one. See docs/theory.md, section 5.
IterationResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                                 ResidueFactors& factors, const FitOptions& options);

/// If no step lowers the cost, the cost is at rounding level if the stationary point is at most this many standard
/// deviations away.
inline constexpr double kRoundingDeviations = 0.05;

/// Part of the weighted power of the data: if no step lowers a residual below it, the residual is rounding, not a
/// stalled fit. 1e-10 of the amplitude, the accuracy of coinciding poles in double precision.
inline constexpr double kNothingLeft = 1e-20;

/// max_i |e_i| / sqrt(M_ii squares), 0 to 1: the cosine between the residual and the effect of a parameter.
/// @param squares sum W |E|^2
double scaled_gradient(const Eigen::MatrixXd& M, const Eigen::VectorXd& e,
                       const std::vector<Eigen::Index>& frozen, double squares);

/// sum W |G|^2 / (2N): the cost without a model.
double signal_cost(const FitProblem& problem);

/// Levenberg-Marquardt damping of the steps of an iteration.
class Damping {
 public:
  static constexpr int kTries = 40;

  /// Whether the next step is tried undamped first.
  bool is_off() const noexcept { return damping_ == 0.0; }

  /// Tries steps with increasing damping until one lowers the cost. @param lowers_cost (damping) -> bool
  template <typename Step>
  bool descend(const Step& lowers_cost, int tries = kTries) {
    for (int i = 0; i < tries && damping_ <= kLargest; ++i) {
      if (lowers_cost(damping_)) {
        if (i == 0) damping_ = damping_ > 1e-9 ? 0.1 * damping_ : 0.0;
        return true;
      }
      damping_ = std::max(10.0 * damping_, 1e-4);
    }
    if (damping_ > kLargest) damping_ = 1e-4;
    return false;
  }

 private:
  static constexpr double kLargest = 1e8;
  double damping_ = 0.0;
};

}  // namespace stageid
