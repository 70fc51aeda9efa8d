#include "estimation/iteration/low_rank_iteration.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimation/problem/pole_bounds.hpp"
#include "estimation/problem/residual.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/uncertainty/low_rank_covariance.hpp"

namespace stageid {
namespace {

class LowRankIteration {
 public:
  LowRankIteration(const FitProblem& problem, FitParameters& beta, const FitOptions& options)
      : problem_(problem),
        beta_(beta),
        options_(options),
        bounds_(problem, beta),
        factors_(problem, beta, options) {}

  LowRankResult run(const DataNoise& noise) {
    LowRankResult out;
    project();
    result_.cost.push_back(result_.end_cost);
    while (iterate_once() && result_.iterations < options_.max_iterations) {
    }
    if (result_.message.empty())
      end(FitStatus::iteration_limit,
          fmt::format("residues of given rank: stopped after {} iterations, {:.1g} standard "
                      "deviations from the first-order condition; scaled gradient {:.2g}",
                      result_.iterations, deviations_, gradient_));
    if (options_.uncertainty && result_.status != FitStatus::singular)
      out.covariance = low_rank_covariance(problem_, beta_, result_.end_cost, factors_, noise,
                                           frozen_, options_.response_variance);
    result_.frozen = frozen_;
    result_.deviations = deviations_;
    out.parameters = factors_.size();
    out.ranks = factors_.ranks();
    out.iteration = std::move(result_);
    return out;
  }

 private:
  /// Projects the unconstrained numerators, weighted by their inverse variances.
  void project() {
    const std::vector<BasisGroup> groups = evaluate_groups(problem_, beta_, true);
    const ArrowSystem system(problem_, beta_, groups, FitMethod::gn,
                             ChannelEquationsUse::only_kept);
    Eigen::MatrixXd weight(problem_.channels(), problem_.functions());
    const Eigen::MatrixXd unit =
        Eigen::MatrixXd::Identity(problem_.functions(), problem_.functions());
    for (Eigen::Index c = 0; c < problem_.channels(); ++c) {
      Eigen::MatrixXd inverse = unit;
      solve_scaled(system.channels()[static_cast<std::size_t>(c)].bb, unit, inverse);
      weight.row(c) = inverse.diagonal().cwiseMax(1e-300).cwiseInverse().transpose();
    }
    weight /= weight.maxCoeff();
    factors_.project(beta_, weight);
    factors_.write_numerators(beta_);
    result_.end_cost = residual_cost(problem_, groups, beta_.B);
  }

  Eigen::VectorXd solve(double damping) const {
    const Eigen::VectorXd scale = N_.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = scale.asDiagonal() * N_ * scale.asDiagonal();
    scaled.diagonal().array() += damping + 1e-13;
    Eigen::VectorXd rhs = scale.cwiseProduct(g_);
    hold_unknowns(frozen_, scaled);
    for (const Eigen::Index i : frozen_) rhs[i] = 0.0;
    return scale.cwiseProduct(scaled.ldlt().solve(rhs));
  }

  bool end(FitStatus status, std::string message) {
    result_.status = status;
    result_.message = std::move(message);
    return false;
  }

  /// @returns whether to continue.
  bool iterate_once() {
    if (options_.limit && options_.limit->reached())
      return end(options_.limit->status(), options_.limit->message());
    const std::vector<BasisGroup> groups = evaluate_groups(problem_, beta_, true);
    const ArrowSystem system(problem_, beta_, groups, FitMethod::gn,
                             ChannelEquationsUse::only_kept);
    N_ = factors_.reduced_matrix(beta_, system);
    g_ = factors_.reduced_gradient(beta_, system);
    if (!N_.allFinite()) return end(FitStatus::singular, "the residue factors are singular");
    frozen_ = bounds_.leaning(beta_, g_.head(problem_.globals()));
    const double squares = 2.0 * static_cast<double>(problem_.size()) * result_.end_cost;
    gradient_ = 0.0;
    for (Eigen::Index i = 0; i < g_.size(); ++i)
      if (std::find(frozen_.begin(), frozen_.end(), i) == frozen_.end())
        gradient_ =
            std::max(gradient_, std::abs(g_[i]) / std::sqrt(std::max(N_(i, i) * squares, 1e-300)));
    const double data = static_cast<double>(problem_.size() * problem_.channels());
    deviations_ = std::sqrt(std::abs(solve(0.0).dot(g_)) * data / squares);
    if (gradient_ < options_.gradient_tolerance || deviations_ < options_.deviation_tolerance)
      return end(FitStatus::gradient_small,
                 fmt::format("residues of given rank: within {:.1g} standard deviations of the "
                             "first-order condition, scaled gradient {:.2g}",
                             deviations_, gradient_));
    if (attempt()) return true;
    if (deviations_ < kRoundingDeviations)
      return end(FitStatus::step_small,
                 fmt::format("residues of given rank: converged: the cost is at rounding level, "
                             "within {:.1g} standard deviations of the first-order condition",
                             deviations_));
    return end(
        FitStatus::cost_stalled,
        fmt::format("residues of given rank: no step lowers the cost, {:.1g} standard deviations "
                    "from the first-order condition; scaled gradient {:.2g}",
                    deviations_, gradient_));
  }

  bool attempt() {
    for (; levenberg_ <= kLargestLevenberg; levenberg_ = std::max(10.0 * levenberg_, 1e-4)) {
      const Eigen::VectorXd step = solve(levenberg_);
      if (!step.allFinite()) continue;
      FitParameters trial = stepped(problem_, beta_, step.head(problem_.globals()));
      if (!bounds_.stabilize(beta_, trial)) continue;
      ResidueFactors factors = factors_;
      factors.step(step);
      factors.write_numerators(trial);
      const double cost = residual_cost(problem_, evaluate_groups(problem_, trial, false), trial.B);
      if (!(cost < result_.end_cost)) continue;
      beta_ = std::move(trial);
      factors_ = std::move(factors);
      result_.end_cost = cost;
      result_.cost.push_back(cost);
      ++result_.iterations;
      if (options_.progress) options_.progress(result_.iterations, cost);
      levenberg_ = levenberg_ > 1e-9 ? 0.1 * levenberg_ : 0.0;
      return true;
    }
    return false;
  }

  const FitProblem& problem_;
  FitParameters& beta_;
  const FitOptions& options_;
  PoleBounds bounds_;
  ResidueFactors factors_;
  IterationResult result_;
  Eigen::MatrixXd N_;
  Eigen::VectorXd g_;
  std::vector<Eigen::Index> frozen_;
  double levenberg_ = 0.0;
  double deviations_ = HUGE_VAL;
  double gradient_ = 1.0;
};

}  // namespace

LowRankResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                               const FitOptions& options, const DataNoise& noise) {
  return LowRankIteration(problem, beta, options).run(noise);
}

}  // namespace stageid
