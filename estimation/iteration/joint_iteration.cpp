// Gauss-Newton on denominators, delays and numerators at once, for weights that couple the channels.
#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/equations/joint_equations.hpp"
#include "estimation/iteration/descent.hpp"

namespace stageid {
namespace {

// Relative, in a quadratic region of the cost: the next step corrects it.
constexpr double kStepTolerance = 1e-2;

class JointIteration : public Descent {
 public:
  JointIteration(const FitProblem& problem, const WeightMatrices& weights, FitParameters& beta,
                 const FitOptions& options)
      : Descent(problem, beta, options), weights_(weights) {
    signal_cost_ = weighted_cost(problem, weights, residual(problem, {}, {}));
  }

 private:
  bool begin() override {
    E_ = residual_at(beta_);
    cost_ = weighted_cost(problem_, weights_, E_);
    return true;
  }

  SplitMatrix residual_at(const FitParameters& beta) const {
    return residual(problem_, evaluate_groups(problem_, beta, false), beta.B);
  }

  bool improve() override {
    const std::vector<BasisGroup> groups = evaluate_groups(problem_, beta_, true);
    const JointEquations equations(problem_, weights_, beta_, groups, E_);
    if (!equations.regular())
      return end(FitStatus::singular, "the numerators are singular: two modes coincide");
    const auto step_of = [&](double damping) {
      return equations.solve(equations.gradient(), result_.frozen, kStepTolerance, damping).x;
    };
    // With the modes held that are at a bound and pushed beyond it.
    result_.frozen.clear();
    Eigen::VectorXd step = step_of(0.0);
    result_.frozen = bounds_.leaning(beta_, step);
    if (!result_.frozen.empty()) step = step_of(0.0);
    const double decrement = std::max(0.0, equations.gradient().dot(step));
    if (!may_continue(std::sqrt(decrement / squares()), decrement)) return false;
    return descend([&](double damping) { return damping == 0.0 ? step : step_of(damping); }) ||
           end_without_step();
  }

  bool take(const Eigen::VectorXd& step) override {
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
    accept(cost);
    return true;
  }

  const WeightMatrices& weights_;
  SplitMatrix E_;  // at beta_
};

}  // namespace

IterationResult iterate(const FitProblem& problem, const WeightMatrices& weights,
                        FitParameters& beta, const FitOptions& options) {
  return JointIteration(problem, weights, beta, options).run();
}

}  // namespace stageid
