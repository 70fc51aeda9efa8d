#include <Eigen/Cholesky>
#include <cmath>

#include "estimation/equations/residue_factors.hpp"
#include "estimation/iteration/descent.hpp"
#include "estimation/problem/residual.hpp"

namespace stageid {
namespace {

class LowRankIteration : public Descent {
 public:
  LowRankIteration(const FitProblem& problem, FitParameters& beta, ResidueFactors& factors,
                   const FitOptions& options)
      : Descent(problem, beta, options), factors_(factors) {
    signal_cost_ = signal_cost(problem);
  }

 private:
  ArrowSystem equations(const FitParameters& beta) const {
    return {problem_, beta, BasisGroups(problem_, beta, true), FitMethod::gn,
            ChannelEquationsUse::only_kept};
  }

  /// Projects the unconstrained numerators, weighted by their inverse variances.
  bool begin() override {
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
    cost_ = cost_of(beta_);
    return true;
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

  bool improve() override {
    const ArrowSystem system = equations(beta_);
    const Eigen::MatrixXd N = factors_.reduced_matrix(beta_, system);
    const Eigen::VectorXd g = factors_.reduced_gradient(beta_, system);
    if (!N.allFinite()) return end(FitStatus::singular, "the residue factors are singular");
    result_.frozen = bounds_.leaning(beta_, g.head(problem_.globals()));
    const auto step_of = [&](double damping) { return solve(N, g, damping, result_.frozen); };
    if (!may_continue(scaled_gradient(N, g, result_.frozen, squares()),
                      std::abs(step_of(0.0).dot(g))))
      return false;
    return descend(step_of) || end_without_step();
  }

  void conclude() override { result_.message.insert(0, "residues of given rank: "); }

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

  bool take(const Eigen::VectorXd& step) override {
    if (!step.allFinite()) return false;
    FitParameters trial = stepped(problem_, beta_, step.head(problem_.globals()));
    if (!bounds_.stabilize(beta_, trial)) return false;
    ResidueFactors factors = factors_;
    factors.step(step);
    factors.write_numerators(trial);
    double cost = cost_of(trial);
    if (!(cost < cost_)) {
      follow(trial, factors);
      cost = cost_of(trial);
    }
    if (!(cost < cost_)) return false;
    beta_ = std::move(trial);
    factors_ = std::move(factors);
    accept(cost);
    return true;
  }

  ResidueFactors& factors_;
};

}  // namespace

IterationResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                                 ResidueFactors& factors, const FitOptions& options) {
  return LowRankIteration(problem, beta, factors, options).run();
}

}  // namespace stageid
