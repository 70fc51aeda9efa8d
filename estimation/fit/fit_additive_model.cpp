#include "estimation/fit/fit_additive_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "estimation/equations/numerators.hpp"
#include "estimation/fit/determinacy.hpp"
#include "estimation/fit/hidden_modes.hpp"
#include "estimation/fit/ranked_fit.hpp"
#include "estimation/fit/residue_ranks.hpp"
#include "estimation/iteration/fit_iteration.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/model/poles.hpp"
#include "estimation/problem/fit_start.hpp"
#include "estimation/problem/parameter_bounds.hpp"
#include "estimation/problem/residual.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/problem/weight_matrices.hpp"
#include "estimation/start/delay_search.hpp"
#include "estimation/uncertainty/dense_covariance.hpp"
#include "estimation/uncertainty/low_rank_covariance.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"

namespace stageid {
namespace {

/// The covariance assumes independent lines; of `correlated_lines` lines, only one is independent.
void raise(ParameterCovariance& covariance, double correlated_lines) {
  covariance.globals *= correlated_lines;
  covariance.numerator_variance *= correlated_lines;
  covariance.response_variance *= correlated_lines;
}

/// Whether all weighted channels are finite; channels without weight are unknown and do not affect the others.
bool weighted_are_finite(const FitProblem& problem, const ParameterCovariance& covariance) {
  return number_over_tiles(*problem.team, problem.channels(), [&](DataRange tile) {
           Eigen::Index infinite = 0;
           for (Eigen::Index c = tile.first; c < tile.first + tile.count; ++c) {
             const bool finite = covariance.numerator_variance.row(c).allFinite() &&
                                 (covariance.response_variance.size() == 0 ||
                                  covariance.response_variance.row(c).allFinite());
             infinite += finite || has_no_weight(problem, c) ? 0 : 1;
           }
           return infinite;
         }) == 0.0;
}

void use_covariance(const FitProblem& problem, ParameterCovariance& covariance, bool likelihood,
                    FitResult& result) {
  if (covariance.numerator_variance.size() == 0) return;
  if (!covariance.globals.allFinite() || !weighted_are_finite(problem, covariance)) {
    result.decisions.emplace_back(
        "no standard deviations: the covariance of the parameters is not finite, because the data "
        "do not support some of them");
    return;
  }
  fill_deviations(problem, covariance, result.model);
  result.response_variance = std::move(covariance.response_variance);
  if (!likelihood || !(covariance.residual_scale > 1.0)) return;
  result.decisions.push_back(
      fmt::format("the residual is {:.3g} times what the variances predict: the model does not "
                  "explain the data; standard deviations are raised by {:.3g}",
                  covariance.residual_scale, std::sqrt(covariance.residual_scale)));
}

/// The covariance with free numerators. @param between_channels also its parts
ParameterCovariance free_covariance(const FrfEstimate& frf, const FitOptions& options,
                                    const FitProblem& problem,
                                    const std::optional<WeightMatrices>& matrices,
                                    const FitParameters& beta, const IterationResult& iteration,
                                    bool between_channels) {
  const std::vector<BasisGroup> groups = evaluate_groups(problem, beta, true);
  if (!matrices)
    return parameter_covariance(problem, beta, groups, iteration.end_cost,
                                data_noise(frf, options.weighting), iteration.frozen,
                                {options.response_variance, between_channels});
  return joint_covariance(
      problem, beta, groups, iteration.end_cost,
      JointEquations(problem, *matrices, beta, groups, residual(problem, groups, beta.B)),
      weighs_by_variance(options.weighting) ? VarianceKnowledge::weights : VarianceKnowledge::none,
      matrices->scatter_factor(), iteration.frozen, options.response_variance);
}

void fill_model(const FrfEstimate& frf, const FitOptions& options, const FitProblem& problem,
                const FitParameters& beta, FitResult& result) {
  result.model.inputs = frf.inputs;
  result.model.outputs = frf.outputs;
  result.model.sample_rate_hz = frf.sample_rate_hz;
  result.model.hold = options.hold;
  result.model.fit.band_hz[0] = frf.frequency_hz[0];
  result.model.fit.band_hz[1] = frf.frequency_hz[frf.lines() - 1];
  fill_submodels(problem, beta, result.model);
  for (std::size_t i = 0; i < beta.a.size(); ++i)
    if (Submodel& s = result.model.submodels[i]; !s.is_mode())
      s.poles = pole_estimates(beta.a[i], Eigen::MatrixXd());
  if (result.removal_cost.empty())
    result.removal_cost = removal_costs(problem, BasisGroups(problem, beta, false), beta.B);
}

void fill_record(const FitOptions& options, const IterationResult& iteration, double relative_rms,
                 FitResult& result) {
  FitRecord& record = result.model.fit;
  record.cost = iteration.end_cost;
  record.weighting = to_string(options.weighting);
  record.iterations = iteration.iterations;
  record.status = iteration.status;
  record.message = iteration.message;
  record.relative_rms_error = relative_rms;
  result.model.cost_history = result.cost;
}

/// Continues to residues of the given ranks. @returns the covariance there
ParameterCovariance constrain_ranks(const FrfEstimate& frf, const FitOptions& options,
                                    const FitProblem& problem, FitParameters& beta,
                                    IterationResult& iteration, FitResult& result) {
  ResidueFactors factors(problem, beta, options);
  IterationResult constrained = iterate_low_rank(problem, beta, factors, options);
  if (options.mode_ranks.empty())
    result.decisions.push_back(rank_decision(
        iteration.end_cost, constrained.end_cost, 2.0 * static_cast<double>(problem.size()),
        problem.parameters() - factors.size(), weighs_by_variance(options.weighting)));
  result.parameters = factors.size();
  constrained.cost.insert(constrained.cost.begin(), iteration.cost.begin(), iteration.cost.end());
  constrained.iterations += iteration.iterations;
  iteration = std::move(constrained);
  for (std::size_t i = 0; i < factors.ranks().size(); ++i)
    if (factors.ranks()[i] > 0) result.model.submodels[i].residue_rank = factors.ranks()[i];
  // Who interrupts a fit does not wait for these deviations: they take longer than the fit.
  const bool interrupted = options.limit && options.limit->was_interrupted();
  if (!options.uncertainty || interrupted || iteration.status == FitStatus::singular) return {};
  return low_rank_covariance(problem, beta, iteration.end_cost, factors,
                             data_noise(frf, options.weighting), iteration.frozen,
                             options.response_variance);
}

/// Shrinks the residues of modes whose poles are held because noise hides them.
void shrink_hidden(const FitProblem& problem, FitParameters& beta, IterationResult& iteration,
                   FitResult& result) {
  std::vector<std::size_t> hidden;
  for (std::size_t i = 0; i < result.model.submodels.size(); ++i)
    if (const Submodel& s = result.model.submodels[i];
        is_searched_mode(s) && s.held != HeldPole::none)
      hidden.push_back(i);
  if (hidden.empty()) return;
  const BasisGroups groups(problem, beta, false);
  double cost = iteration.end_cost;
  result.removal_cost =
      removal_costs(problem, groups, beta.B);  // of the solution of the convex problem
  shrink_hidden_modes(problem, groups, hidden, result.removal_cost, beta.B, cost);
  result.decisions.push_back(
      fmt::format("residues of {} below the noise, James-Stein shrinkage: cost {:.6g} -> {:.6g}",
                  counted(hidden.size(), "mode"), iteration.end_cost, cost));
  iteration.end_cost = cost;
  iteration.cost.push_back(cost);
}

/// Removes the results of an earlier fit from the start.
void forget_results(AdditiveModel& model) {
  model.input_delay_std_s.resize(0);
  model.output_delay_std_s.resize(0);
  for (Submodel& s : model.submodels) {
    s.natural_frequency_std_hz.reset();
    s.damping_ratio_std.reset();
    s.shape_std.reset();
    s.numerator_std.clear();
    s.residue_rank.reset();
    s.verdict.reset();
    s.poles.clear();
  }
}

/// If the start has no finite response, the start itself is returned, without numerators.
/// @returns relative error of the result
double keep_finite(const FrfEstimate& frf, const FitProblem& problem, const FitParameters& start,
                   FitParameters& beta, IterationResult& iteration) {
  const ChannelFlags responding = responding_channels(frf);
  bool finite = beta.B.allFinite() && !iteration.cost.empty();
  for (const Eigen::VectorXd& a : beta.a) finite = finite && a.allFinite();
  if (finite) {
    const ResidualSize E =
        residual_size(problem, evaluate_groups(problem, beta, false), beta.B, responding);
    if (E.finite) return E.relative_rms;
  }
  beta = start;
  beta.B.setZero();
  iteration.end_cost = signal_cost(problem);
  iteration.status = FitStatus::singular;
  iteration.cost.assign(1, iteration.end_cost);
  if (iteration.message.empty()) iteration.message = "the start has no finite response";
  return residual_size(problem, {}, {}, responding).relative_rms;
}

std::vector<std::size_t> held_submodels(const FitProblem& problem, const FitParameters& beta,
                                        const std::vector<Eigen::Index>& frozen) {
  const ParameterBounds bounds(problem, beta);
  std::vector<std::size_t> out;
  Eigen::Index first = 0;
  for (std::size_t i = 0; i < beta.a.size(); ++i) {
    const Eigen::Index n = beta.a[i].size();
    const bool held = std::any_of(frozen.begin(), frozen.end(),
                                  [&](Eigen::Index p) { return p >= first && p < first + n; });
    if (held || (n > 2 && bounds.at_bound(i, beta.a[i]))) out.push_back(i);
    first += n;
  }
  return out;
}

/// A converged fit becomes undetermined if the data leave a requested submodel undetermined; one that has not
/// converged gets the reason too.
void judge(const FitProblem& problem, const FitParameters& beta, const Eigen::MatrixXd& covariance,
           bool judge_modes, FitResult& result) {
  const bool asked_for =
      judge_modes || std::any_of(result.model.submodels.begin(), result.model.submodels.end(),
                                 [](const Submodel& s) {
                                   return s.role == SubmodelRole::given ||
                                          (s.denominator.size() > 1 && !s.is_mode());
                                 });
  const bool singular = result.status() == FitStatus::singular;
  if (!asked_for && !singular) return;
  const std::vector<BasisGroup> groups = evaluate_groups(problem, beta, true);
  std::string reason = undetermined_numerators(problem, beta, groups);
  if (reason.empty() && !singular) {
    const ArrowSystem gn(problem, beta, groups, FitMethod::gn, ChannelEquationsUse::eliminated);
    reason = undetermined_poles(problem, beta, gn, covariance, judge_modes, result);
  }
  if (reason.empty()) return;
  result.model.fit.distrust({FitStatus::undetermined, reason});
}

}  // namespace

FitResult fit_additive_model(const FrfEstimate& frf, const AdditiveModel& start,
                             const FitOptions& options) {
  check_start(frf, start, options);
  const std::optional<WeightMatrices> matrices = make_weight_matrices(frf, options);
  const bool searched = options.delay != DelayModel::fixed && options.delay_s == 0.0 &&
                        start.input_delay_s.size() == 0;
  // The search computes its own weights; from the user's weights it only needs which are zero.
  const bool later = searched && !matrices && options.weighting != Weighting::user;
  SharedMatrix<Eigen::MatrixXd> W;
  if (matrices)
    W = SharedMatrix<Eigen::MatrixXd>::kept(matrices->marginal());
  else if (!later)
    W = make_weights(frf, options);
  FitProblem problem = make_problem(frf, start, options, std::move(W));
  FitParameters beta = make_parameters(problem, start, options);
  if (searched) search_delay(problem, beta);
  if (later) problem.W = make_weights(frf, options);

  const FitParameters begun = beta;
  FitResult result;
  result.model = start;
  forget_results(result.model);
  IterationResult iteration;
  if (options.mode_ranks.empty()) iteration = iterate(problem, beta, options);
  if (matrices && iteration.status != FitStatus::singular) {
    result.decisions.push_back(fmt::format(
        "weight matrices: started from their best diagonal approximation, {} iterations ({})",
        iteration.iterations, to_string(iteration.status)));
    iteration = iterate(problem, *matrices, beta, options);
  }
  ParameterCovariance covariance;
  result.parameters = problem.parameters();
  result.delay = options.delay;
  const bool low_rank = options.residue_rank > 0 || options.rigid_body_rank > 0;
  if (low_rank && iteration.status != FitStatus::singular)
    covariance = constrain_ranks(frf, options, problem, beta, iteration, result);
  if (options.shrink_hidden && !low_rank && iteration.status != FitStatus::singular)
    shrink_hidden(problem, beta, iteration, result);
  const double relative_rms = keep_finite(frf, problem, begun, beta, iteration);
  result.cost = iteration.cost;
  result.deviations = iteration.deviations;
  result.held = held_submodels(problem, beta, iteration.frozen);
  drop_guesses(result.model, problem.held);  // from here on, for the covariance
  drop_guesses(result.model, iteration.frozen);
  result.frozen = iteration.frozen;
  fill_model(frf, options, problem, beta, result);
  fill_record(options, iteration, relative_rms, result);
  if (options.uncertainty) {
    if (!low_rank && result.status() != FitStatus::singular)
      covariance = free_covariance(frf, options, problem, matrices, beta, iteration,
                                   have_affordable_covariances(problem, result.model));
    result.covariance_parts = std::move(covariance.parts);
    raise(covariance, frf.correlated_lines);
    use_covariance(problem, covariance, weighs_by_variance(options.weighting), result);
    if (!low_rank)
      result.residue_ranks = residue_rank_tests(result.model, frf.independent_numbers());
    judge(problem, beta, covariance.globals, options.judge_modes, result);
  }
  return result;
}

void rearrange(const std::vector<std::size_t>& sources, FitResult& fit) {
  std::vector<Eigen::Index> first = {0};  // first coefficient of every submodel
  for (const Submodel& s : fit.model.submodels)
    first.push_back(first.back() + static_cast<Eigen::Index>(s.denominator.size()) - 1);
  AdditiveModel model = fit.model;
  model.submodels.clear();
  std::vector<double> removal;
  std::vector<std::size_t> held;
  std::vector<Eigen::Index> frozen;
  Eigen::Index next = 0;
  for (const std::size_t i : sources) {
    if (fit.is_held(i)) held.push_back(model.submodels.size());
    for (const Eigen::Index p : fit.frozen)
      if (p >= first[i] && p < first[i + 1]) frozen.push_back(next + p - first[i]);
    next += first[i + 1] - first[i];
    model.submodels.push_back(fit.model.submodels[i]);
    removal.push_back(fit.removal_cost[i]);
  }
  for (std::size_t i = 0; i < sources.size(); ++i)
    if (sources[i] != i) fit.covariance_parts.reset();  // of another order
  fit.model = std::move(model);
  fit.removal_cost = std::move(removal);
  fit.held = std::move(held);
  fit.frozen = std::move(frozen);
}

void sort_modes(FitResult& fit) { rearrange(mode_order(fit.model), fit); }

}  // namespace stageid
