#include "estimation/iteration/fit_iteration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/factored_equations.hpp"
#include "estimation/equations/numerators.hpp"
#include "estimation/iteration/descent.hpp"
#include "estimation/iteration/secant_curvature.hpp"

namespace stageid {
namespace {

// At rounding level, a step that does not reduce the cost to this share is the last one.
constexpr double kGainAtRounding = 0.5;
constexpr int kTriesAtRounding = 3;
constexpr int kTriesOfRiv = 3;  // before the Gauss-Newton step
// Most iterations converge in fewer steps, and the trials of a search are given fewer.
constexpr int kSlow = 15;
// Numerators are re-solved after every step.
constexpr ChannelEquationsUse kGlobalsOnly = ChannelEquationsUse::eliminated;

/// A candidate with its numerators solved.
struct Trial {
  FitParameters beta;
  SolvedNumerators solved = {};
};

/// Largest change of a denominator coefficient or delay, relative to its own size.
double relative_step(const FitProblem& problem, const FitParameters& beta,
                     const Eigen::VectorXd& step) {
  double largest = 0.0;
  Eigen::Index p = 0;
  for (const Eigen::VectorXd& a : beta.a)
    for (Eigen::Index q = 0; q < a.size(); ++q)
      largest = std::max(largest, std::abs(step[p++]) / std::max(std::abs(a[q]), 1e-300));
  const double time = 1.0 / problem.lines.omega_rad_s.maxCoeff();
  for (; p < step.size(); ++p) largest = std::max(largest, std::abs(step[p]) / time);
  return largest;
}

class Iteration : public Descent {
 public:
  Iteration(const FitProblem& problem, FitParameters& beta, const FitOptions& options)
      : Descent(problem, beta, options) {
    signal_cost_ = signal_cost(problem);
    has_unknowns_ = problem.globals() > 0;
  }

 private:
  bool begin() override {
    bounds_.stabilize(beta_, beta_);
    Trial start{beta_};
    const bool solved = solve(start);
    move_to(std::move(start));
    if (!solved)
      return end(FitStatus::singular,
                 "the numerators of the start are singular: two modes coincide, or the data do not "
                 "excite them");
    return true;
  }

  bool improve() override { return is_fixed_point() ? fixed_point_step() : descent_step(); }

  /// From the other side of a jump, see ParameterBounds.
  bool passes_jump() override {
    const std::optional<Eigen::VectorXd> step = bounds_.step_over_jump(problem_, beta_);
    return !is_fixed_point() && step && take(*step);
  }

  bool take(const Eigen::VectorXd& step) override {
    step_size_ = relative_step(problem_, beta_, step);
    std::optional<Trial> trial = try_step(step);
    if (!trial || !(trial->solved.cost < cost_)) return false;
    moved_ = step;
    Eigen::Index p = 0;
    for (std::size_t i = 0; i < beta_.a.size(); p += beta_.a[i++].size())
      moved_.segment(p, beta_.a[i].size()) = trial->beta.a[i] - beta_.a[i];
    accept_trial(std::move(*trial));
    return true;
  }

  void conclude() override {
    if (best_ && best_->solved.cost < cost_) move_to(std::move(*best_));
  }

  bool is_fixed_point() const { return options_.method == FitMethod::sk; }

  /// Numerators and cost of the candidate.
  bool solve(Trial& trial) {
    const auto solved =
        solve_numerators(problem_, BasisGroups(problem_, trial.beta, false), trial.beta.B);
    if (solved) trial.solved = *solved;
    return solved.has_value();
  }

  std::optional<Trial> try_step(const Eigen::VectorXd& step) {
    if (!step.allFinite()) return std::nullopt;
    Trial trial{stepped(problem_, beta_, step)};
    if (!bounds_.stabilize(beta_, trial.beta) || !solve(trial)) return std::nullopt;
    return trial;
  }

  void move_to(Trial&& trial) {
    beta_ = std::move(trial.beta);
    cost_ = trial.solved.cost;
    factored_ = trial.solved.factored;
  }

  void accept_trial(Trial&& trial) {
    accept(trial.solved.cost);
    move_to(std::move(trial));
  }

  double gradient_of(const auto& system) {
    result_.frozen = bounds_.leaning(beta_, system.schur_gradient());
    return scaled_gradient(system.schur(), system.schur_gradient(), result_.frozen, squares());
  }

  /// @returns false if the equations show convergence
  bool goes_on_with(const auto& system) {
    const double gradient = gradient_of(system);
    curvature_.learn(system.schur(), system.schur_gradient(), moved_);
    return may_continue(
        gradient, std::abs(system.solve_globals(0.0, result_.frozen).dot(system.schur_gradient())));
  }

  bool descent_step() { return factored_ || at_rounding() ? factored_step() : summed_step(); }

  bool summed_step() {
    const BasisGroups groups(problem_, beta_, true);
    const ArrowSystem system(problem_, beta_, groups, options_.method, kGlobalsOnly);
    if (!system.regular())
      return end(FitStatus::singular, "the numerators are singular: two modes coincide");
    if (!goes_on_with(system)) return false;
    if (attempt_learned()) return still_moving();
    if (attempt_by(system, options_.method == FitMethod::riv ? kTriesOfRiv : Damping::kTries))
      return still_moving();
    if (options_.method == FitMethod::riv) {
      const ArrowSystem gauss_newton(problem_, beta_, groups, FitMethod::gn, kGlobalsOnly);
      if (attempt_by(gauss_newton)) return still_moving();
    }
    return end_without_step();
  }

  /// By Gauss-Newton: without a residual, the refined-IV equations are the same.
  bool factored_step() {
    const std::vector<BasisGroup> groups = evaluate_groups(problem_, beta_, true);
    gather_numerators(problem_, beta_.B);
    const FactoredEquations system(problem_, beta_, groups);
    if (!goes_on_with(system)) return false;
    if (!at_rounding() && attempt_learned()) return still_moving();
    const double before = cost_;
    if (attempt_by(system, at_rounding() ? kTriesAtRounding : Damping::kTries) &&
        !(at_rounding() && cost_ > kGainAtRounding * before))
      return still_moving();
    return end_without_step();
  }

  /// Of a slow iteration: the step with the learned curvature.
  bool attempt_learned() {
    if (damping_.is_off() || result_.iterations < kSlow) return false;
    const std::optional<Eigen::VectorXd> step = curvature_.step(result_.frozen);
    return step && attempt(*step);
  }

  bool attempt_by(const auto& system, int tries = Damping::kTries) {
    return descend([&](double damping) { return system.solve_globals(damping, result_.frozen); },
                   tries);
  }

  bool still_moving() {
    if (step_size_ < options_.step_tolerance)
      return end(FitStatus::step_small,
                 fmt::format("the last step was {:.1e} of the parameters", step_size_));
    return true;
  }

  bool fixed_point_step() {
    if (!best_) best_ = Trial{beta_, {cost_}};
    const ArrowSystem system(problem_, beta_, BasisGroups(problem_, beta_, true), FitMethod::sk,
                             kGlobalsOnly);
    if (!system.regular())
      return end(FitStatus::singular, "the numerators are singular: two modes coincide");
    result_.gradient = gradient_of(system);
    Eigen::VectorXd step = system.solve_globals(0.0, result_.frozen);
    std::optional<Trial> trial;
    for (int halvings = 0; halvings < 12 && !trial; ++halvings, step *= 0.5) {
      step_size_ = relative_step(problem_, beta_, step);
      trial = try_step(step);
    }
    if (!trial) return end(FitStatus::cost_stalled, "no acceptable step");
    accept_trial(std::move(*trial));
    if (cost_ < best_->solved.cost) best_ = Trial{beta_, {cost_}};
    if (step_size_ < std::max(options_.step_tolerance, 1e-9))
      return end(
          FitStatus::step_small,
          "reached the Sanathanan-Koerner fixed point, which is not the minimum of the cost");
    return true;
  }

  bool factored_ = false;  // see Trial; then the equations of the step too
  double step_size_ = 0.0;
  Eigen::VectorXd moved_;  // the globals by the last step
  SecantCurvature curvature_;
  std::optional<Trial> best_;  // of fixed-point steps, which need not lower the cost
};

}  // namespace

double signal_cost(const FitProblem& problem) {
  const Eigen::VectorXd sum =
      sum_over_tiles(*problem.team, problem.channels(), 1, [&](DataRange tile) {
        const auto W = problem.W->middleRows(tile.first, tile.count).array();
        const auto G = problem.G->middleRows(tile.first, tile.count).array();
        return Eigen::VectorXd::Constant(1, (W * G.abs2()).sum()).eval();
      });
  return sum[0] / (2.0 * static_cast<double>(problem.size()));
}

IterationResult iterate(const FitProblem& problem, FitParameters& beta, const FitOptions& options) {
  IterationResult result = Iteration(problem, beta, options).run();
  gather_numerators(problem, beta.B);
  return result;
}

}  // namespace stageid
