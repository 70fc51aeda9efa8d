// Gauss-Newton on denominators, delays and numerators at once, for weights that couple the channels.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/equations/joint_equations.hpp"
#include "estimation/iteration/fit_iteration.hpp"
#include "estimation/problem/pole_bounds.hpp"
#include "estimation/problem/search_limit.hpp"

namespace stageid {
namespace {

// Relative, in a quadratic region of the cost: the next step corrects it.
constexpr double kStepTolerance = 1e-2;

class JointIteration {
 public:
  JointIteration(const FitProblem& problem, const WeightMatrices& weights, FitParameters& beta,
                 const FitOptions& options)
      : problem_(problem),
        weights_(weights),
        beta_(beta),
        options_(options),
        bounds_(problem, beta) {
    signal_cost_ = weighted_cost(problem, weights, residual(problem, {}, {}));
  }

  IterationResult run() {
    E_ = residual_at(beta_);
    cost_ = weighted_cost(problem_, weights_, E_);
    result_.cost.push_back(cost_);
    while (iterate_once()) {
    }
    result_.end_cost = cost_;
    bounds_.drop_delays(result_.frozen);
    return std::move(result_);
  }

 private:
  SplitMatrix residual_at(const FitParameters& beta) const {
    return residual(problem_, evaluate_groups(problem_, beta, false), beta.B);
  }

  /// @returns false at the end; `result_` then has the reason.
  bool iterate_once() {
    if (options_.limit && options_.limit->reached())
      return result_.end(options_.limit->status(), options_.limit->message());
    const std::vector<BasisGroup> groups = evaluate_groups(problem_, beta_, true);
    const JointEquations equations(problem_, weights_, beta_, groups, E_);
    if (!equations.regular())
      return result_.end(FitStatus::singular, "the numerators are singular: two modes coincide");
    const Eigen::VectorXd step = free_step(equations);
    if (!may_continue(equations.gradient().dot(step))) return false;
    if (result_.iterations >= options_.max_iterations)
      return result_.end_here(FitStatus::iteration_limit,
                              fmt::format("stopped after {} iterations", result_.iterations));
    const auto lowers_cost = [&](double damping) {
      return bounds_.try_to_jump(
          problem_, beta_,
          damping == 0.0
              ? step
              : equations.solve(equations.gradient(), result_.frozen, kStepTolerance, damping).x,
          [this](const Eigen::VectorXd& part) { return take(part); });
    };
    if (damping_.descend(lowers_cost)) return true;
    if (cost_ < kNothingLeft * signal_cost_)
      return result_.end(
          FitStatus::step_small,
          "converged: the residual is at rounding level and no step lowers the cost");
    return result_.end_without_step();
  }

  /// The step, with the modes held that are at a bound and pushed beyond it.
  Eigen::VectorXd free_step(const JointEquations& equations) {
    result_.frozen.clear();
    Eigen::VectorXd step = equations.solve(equations.gradient(), result_.frozen, kStepTolerance).x;
    result_.frozen = bounds_.leaning(beta_, step);
    if (result_.frozen.empty()) return step;
    return equations.solve(equations.gradient(), result_.frozen, kStepTolerance).x;
  }

  /// By the Newton decrement over all parameters: the length of the step in standard deviations of the noise estimated
  /// from the residual, and as a part of that residual.
  bool may_continue(double decrement) {
    const double squares = 2.0 * static_cast<double>(problem_.size()) * cost_;
    result_.gradient = std::sqrt(std::max(decrement, 0.0) / std::max(squares, 1e-300));
    result_.deviations =
        result_.gradient * std::sqrt(static_cast<double>(problem_.size() * problem_.channels()));
    if (cost_ < 1e-28 * signal_cost_)
      return result_.end(FitStatus::gradient_small, "converged: the residual is at rounding level");
    if (result_.gradient >= options_.gradient_tolerance &&
        result_.deviations >= options_.deviation_tolerance)
      return true;
    return result_.end_here(FitStatus::gradient_small, "converged");
  }

  bool take(const Eigen::VectorXd& step) {
    if (!step.allFinite()) return false;
    const Eigen::Index globals = problem_.globals();
    FitParameters trial = stepped(problem_, beta_, step.head(globals));
    trial.B += step.tail(step.size() - globals).reshaped(trial.B.rows(), trial.B.cols());
    if (!bounds_.stabilize(beta_, trial)) return false;
    SplitMatrix E = residual_at(trial);
    const double cost = weighted_cost(problem_, weights_, E);
    if (!(cost < cost_)) return false;
    beta_ = std::move(trial);
    E_ = std::move(E);
    cost_ = cost;
    result_.accept(cost_, options_);
    return true;
  }

  const FitProblem& problem_;
  const WeightMatrices& weights_;
  FitParameters& beta_;
  const FitOptions& options_;
  PoleBounds bounds_;
  SplitMatrix E_;      // at beta_
  double cost_ = 0.0;  // at beta_
  IterationResult result_;
  double signal_cost_ = 0.0;
  Damping damping_;
};

}  // namespace

IterationResult iterate(const FitProblem& problem, const WeightMatrices& weights,
                        FitParameters& beta, const FitOptions& options) {
  return JointIteration(problem, weights, beta, options).run();
}

}  // namespace stageid
