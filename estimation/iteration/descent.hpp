#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <string>
#include <vector>

#include "estimation/iteration/fit_iteration.hpp"
#include "estimation/problem/parameter_bounds.hpp"

namespace stageid {

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

/// max_i |e_i| / sqrt(M_ii squares), 0 to 1: the cosine between the residual and the effect of a parameter.
/// @param squares sum W |E|^2
double scaled_gradient(const Eigen::MatrixXd& M, const Eigen::VectorXd& e,
                       const std::vector<Eigen::Index>& frozen, double squares);

/// Damped steps to lower costs until the first-order condition holds. What differs are the equations of a step, and which
/// unknowns it moves: `beta_`, `cost_` there, and more of a derived class.
class Descent {
 public:
  Descent(const FitProblem& problem, FitParameters& beta, const FitOptions& options)
      : problem_(problem), beta_(beta), options_(options), bounds_(problem, beta) {}
  Descent(const Descent&) = delete;
  Descent& operator=(const Descent&) = delete;
  virtual ~Descent() = default;

  IterationResult run();

 protected:
  /// Completes the start. @returns false: it has no cost; the end has been said
  virtual bool begin() = 0;
  /// One iteration. @returns false at the end, which has been said
  virtual bool improve() = 0;
  /// Moves if that lowers the cost. @param step of all unknowns
  virtual bool take(const Eigen::VectorXd& step) = 0;
  /// Whether the iteration goes on after its end, at another place of lower cost.
  virtual bool passes_jump() { return false; }
  /// After the last step.
  virtual void conclude() {}

  double squares() const { return 2.0 * static_cast<double>(problem_.size()) * cost_; }
  /// Whether the residual is rounding: 1e-10 of the amplitude of the data, the accuracy of coinciding poles in double
  /// precision. If no step lowers it then, the fit is not stalled.
  bool at_rounding() const { return cost_ < 1e-20 * signal_cost_; }
  bool attempt(const Eigen::VectorXd& step) {
    return bounds_.try_to_jump(problem_, beta_, step,
                               [this](const Eigen::VectorXd& part) { return take(part); });
  }
  /// @param step_of (damping) -> step
  template <typename StepOf>
  bool descend(const StepOf& step_of, int tries = Damping::kTries) {
    return damping_.descend([&](double damping) { return attempt(step_of(damping)); }, tries);
  }
  /// Counts a step to a lower cost.
  void accept(double lower);

  // The ends. All return false.

  bool end(FitStatus why, std::string reason);
  /// With the distance from the first-order condition.
  bool end_here(FitStatus why, const std::string& what);
  /// If no step lowers the cost: at rounding level, or stalled.
  bool end_without_step();
  /// @returns whether the first-order condition does not hold yet
  /// @param gradient scaled, see FitOptions::gradient_tolerance
  /// @param decrement by which the quadratic with the equations of the step would lower sum W |E|^2 (Newton decrement)
  bool may_continue(double gradient, double decrement);

  const FitProblem& problem_;
  FitParameters& beta_;
  const FitOptions& options_;
  ParameterBounds bounds_;
  IterationResult result_;
  double cost_ = 0.0;         // at beta_
  double signal_cost_ = 0.0;  // without a model
  bool has_unknowns_ = true;  // else the start is the end
  Damping damping_;

 private:
  bool go_on();
};

}  // namespace stageid
