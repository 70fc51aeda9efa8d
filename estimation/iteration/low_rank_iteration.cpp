#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "estimation/equations/residue_factors.hpp"
#include "estimation/iteration/fit_iteration.hpp"
#include "estimation/problem/pole_bounds.hpp"
#include "estimation/problem/residual.hpp"
#include "estimation/problem/search_limit.hpp"

namespace stageid {
namespace {

class LowRankIteration {
 public:
  LowRankIteration(const FitProblem& problem, FitParameters& beta, ResidueFactors& factors,
                   const FitOptions& options)
      : problem_(problem),
        beta_(beta),
        factors_(factors),
        options_(options),
        bounds_(problem, beta) {}

  IterationResult run() {
    project();
    result_.cost.push_back(result_.end_cost);
    while (iterate_once() && result_.iterations < options_.max_iterations) {
    }
    if (result_.message.empty())
      result_.end_here(FitStatus::iteration_limit,
                       fmt::format("stopped after {} iterations", result_.iterations));
    result_.message.insert(0, "residues of given rank: ");
    bounds_.drop_delays(result_.frozen);
    return std::move(result_);
  }

 private:
  ArrowSystem equations(const FitParameters& beta) const {
    return {problem_, beta, evaluate_groups(problem_, beta, true), FitMethod::gn,
            ChannelEquationsUse::only_kept};
  }

  /// Projects the unconstrained numerators, weighted by their inverse variances.
  void project() {
    const ArrowSystem system = equations(beta_);
    Eigen::MatrixXd weight(problem_.channels(), problem_.functions());
    const Eigen::MatrixXd unit =
        Eigen::MatrixXd::Identity(problem_.functions(), problem_.functions());
    for (Eigen::Index c = 0; c < problem_.channels(); ++c) {
      Eigen::MatrixXd inverse = unit;
      solve_scaled(system.channel(c).bb, unit, inverse);
      weight.row(c) = inverse.diagonal().cwiseMax(1e-300).cwiseInverse().transpose();
    }
    weight /= weight.maxCoeff();
    factors_.project(beta_, weight);
    factors_.write_numerators(beta_);
    result_.end_cost = cost_of(beta_);
  }

  static Eigen::VectorXd solve(const Eigen::MatrixXd& N, const Eigen::VectorXd& g, double damping,
                               const std::vector<Eigen::Index>& held) {
    const Eigen::VectorXd scale = N.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = scale.asDiagonal() * N * scale.asDiagonal();
    scaled.diagonal().array() += damping + 1e-13;
    Eigen::VectorXd rhs = scale.cwiseProduct(g);
    hold_unknowns(held, scaled);
    for (const Eigen::Index i : held) rhs[i] = 0.0;
    return scale.cwiseProduct(scaled.ldlt().solve(rhs));
  }

  /// @returns whether to continue.
  bool iterate_once() {
    if (options_.limit && options_.limit->reached())
      return result_.end(options_.limit->status(), options_.limit->message());
    const ArrowSystem system = equations(beta_);
    N_ = factors_.reduced_matrix(beta_, system);
    g_ = factors_.reduced_gradient(beta_, system);
    if (!N_.allFinite())
      return result_.end(FitStatus::singular, "the residue factors are singular");
    result_.frozen = bounds_.leaning(beta_, g_.head(problem_.globals()));
    const double squares = 2.0 * static_cast<double>(problem_.size()) * result_.end_cost;
    result_.gradient = scaled_gradient(N_, g_, result_.frozen, squares);
    const double data = static_cast<double>(problem_.size() * problem_.channels());
    result_.deviations =
        std::sqrt(std::abs(solve(N_, g_, 0.0, result_.frozen).dot(g_)) * data / squares);
    if (result_.gradient < options_.gradient_tolerance ||
        result_.deviations < options_.deviation_tolerance)
      return result_.end_here(FitStatus::gradient_small, "converged");
    if (damping_.descend(
            [&](double damping) { return attempt(solve(N_, g_, damping, result_.frozen)); }))
      return true;
    return result_.end_without_step();
  }

  double cost_of(const FitParameters& beta) const {
    return residual_cost(problem_, evaluate_groups(problem_, beta, false), beta.B);
  }

  /// Fits the factors to poles that have moved too far for the linear step of both.
  void follow(FitParameters& beta, ResidueFactors& factors) const {
    const ArrowSystem system = equations(beta);
    const Eigen::MatrixXd N = factors.reduced_matrix(beta, system);
    if (!N.allFinite()) return;
    factors.step(
        solve(N, factors.reduced_gradient(beta, system), 0.0, indices(0, problem_.globals())));
    factors.write_numerators(beta);
  }

  bool attempt(const Eigen::VectorXd& step) {
    return bounds_.try_to_jump(problem_, beta_, step,
                               [this](const Eigen::VectorXd& part) { return take(part); });
  }

  /// @returns false if the step does not lower the cost
  bool take(const Eigen::VectorXd& step) {
    if (!step.allFinite()) return false;
    FitParameters trial = stepped(problem_, beta_, step.head(problem_.globals()));
    if (!bounds_.stabilize(beta_, trial)) return false;
    ResidueFactors factors = factors_;
    factors.step(step);
    factors.write_numerators(trial);
    double cost = cost_of(trial);
    if (!(cost < result_.end_cost)) {
      follow(trial, factors);
      cost = cost_of(trial);
    }
    if (!(cost < result_.end_cost)) return false;
    beta_ = std::move(trial);
    factors_ = std::move(factors);
    result_.accept(cost, options_);
    result_.end_cost = cost;
    return true;
  }

  const FitProblem& problem_;
  FitParameters& beta_;
  ResidueFactors& factors_;
  const FitOptions& options_;
  PoleBounds bounds_;
  IterationResult result_;
  Eigen::MatrixXd N_;
  Eigen::VectorXd g_;
  Damping damping_;
};

}  // namespace

IterationResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                                 ResidueFactors& factors, const FitOptions& options) {
  return LowRankIteration(problem, beta, factors, options).run();
}

}  // namespace stageid
