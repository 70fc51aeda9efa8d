#include "estimation/search/search_advice.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/search/fit_additive_model.hpp"
#include "estimation/search/mode_worth.hpp"
#include "estimation/search/proposed_modes.hpp"
#include "estimation/search/structure_moves.hpp"
#include "estimation/search/trial_options.hpp"

namespace stageid {
namespace {

constexpr double kMostOfCost = 0.5;  // one end of the band has more than the rest
constexpr double kSmallEnd = 0.25;   // of the lines
constexpr double kMoreBudget = 4.0;  // factor for the next budget to try
constexpr double kNoiseOnly = 2.0;   // |G|^2 over its variance: the response is below the noise
constexpr double kMostLines = 0.5;

/// The names of inputs or outputs whose entries are all noise on most lines.
std::vector<std::string> silent_channels(const FrfEstimate& frf, bool inputs) {
  const Eigen::MatrixXd& variance =
      frf.noise_variance.size() > 0 ? frf.noise_variance : frf.total_variance;
  std::vector<std::string> names;
  if (variance.size() == 0) return names;
  const Eigen::Index count = inputs ? frf.n_inputs() : frf.n_outputs();
  for (Eigen::Index i = 0; i < count; ++i) {
    Eigen::Index noisy = 0;
    Eigen::Index all = 0;
    for (Eigen::Index c = 0; c < frf.response.rows(); ++c) {
      if ((inputs ? c / frf.n_outputs() : c % frf.n_outputs()) != i) continue;
      const auto power = frf.response.row(c).cwiseAbs2().array();
      noisy += (power < kNoiseOnly * variance.row(c).array()).count();
      all += frf.lines();
    }
    if (static_cast<double>(noisy) > kMostLines * static_cast<double>(all))
      names.push_back((inputs ? frf.inputs : frf.outputs).names[static_cast<std::size_t>(i)]);
  }
  if (static_cast<Eigen::Index>(names.size()) == count) names.clear();
  return names;
}

std::string without_silent_channels(const FrfEstimate& frf) {
  for (const bool inputs : {true, false}) {
    const std::vector<std::string> silent = silent_channels(frf, inputs);
    if (silent.empty()) continue;
    std::vector<std::string> rest;
    for (const std::string& name : (inputs ? frf.inputs : frf.outputs).names)
      if (std::find(silent.begin(), silent.end(), name) == silent.end()) rest.push_back(name);
    return fmt::format(
        "The response of {} is below its noise on most lines: exclude it with 'frf {} {}'",
        fmt::join(silent, ", "), inputs ? "--inputs" : "--outputs", fmt::join(rest, ","));
  }
  return {};
}

std::string better_structure(const FrfEstimate& frf, const FitOptions& options,
                             const FitOptions& trial, const FitResult& same, bool cut_short) {
  double least = information_criterion(frf, same);
  std::string advice;
  const OpenStructure open{.rigid_body = true,
                           .direct_term = true,
                           .general_damping = options.residue_rank <= 1,
                           .delay = true};
  std::vector<StructureMove> moves = richer_structures(frf, trial, same.model, open);
  for (StructureMove& move : simpler_structures(trial, same.model, {.rigid_body = true}))
    moves.push_back(std::move(move));
  std::erase_if(moves, [&](const StructureMove& move) {  // of other modes, not of the structure
    return count_modes(move.model) > count_modes(same.model);
  });
  if (!cut_short)  // such a search would add modes in any case
    for (const ProposedMode& missed :
         proposed_modes(frf, same.model, trial.user_weights, 1, trial.threads)) {
      moves.push_back({"more modes", same.model, trial});
      moves.back().model.submodels.push_back(mode_submodel(frf, {}, missed.mode));
    }
  for (const StructureMove& other : moves) {
    const FitResult fit = fit_additive_model(frf, other.model, other.options);
    const double criterion = information_criterion(frf, fit);
    if (fit.status() == FitStatus::singular || !(criterion < least)) continue;
    least = criterion;
    advice = fmt::format("Try {}: one refit lowers the cost from {:.6g} to {:.6g}", other.flag,
                         same.model.fit.cost, fit.model.fit.cost);
  }
  return advice;
}

/// The band without its worse end, if the smaller part of the lines has the larger part of the cost.
std::string better_band(const FrfEstimate& frf, const FitOptions& trial, const FitResult& fit) {
  const Eigen::MatrixXcd error =
      frf.response - response(fit.model, frf.frequency_hz, fit.model.hold);
  const Eigen::VectorXd squares =
      trial.user_weights->cwiseProduct(error.cwiseAbs2()).colwise().sum().transpose();
  const auto end = static_cast<Eigen::Index>(kSmallEnd * static_cast<double>(frf.lines()));
  const double most = kMostOfCost * squares.sum();
  const Eigen::Index last = frf.lines() - 1;
  if (end < 1) return {};
  const auto advice = [&](double low_hz, double high_hz, const char* which) {
    return fmt::format(
        "The {} quarter of the lines causes most of the cost: try --band {:.6g} {:.6g}", which,
        low_hz, high_hz);
  };
  if (squares.head(end).sum() > most)
    return advice(frf.frequency_hz[end], frf.frequency_hz[last], "lowest");
  if (squares.tail(end).sum() > most)
    return advice(frf.frequency_hz[0], frf.frequency_hz[last - end], "highest");
  return {};
}

}  // namespace

std::string advice_for(const FrfEstimate& frf, const FitOptions& options, const FitResult& fit,
                       bool cut_short) {
  std::string advice = without_silent_channels(frf);
  if (!advice.empty()) return advice;
  FitOptions trial = trial_options(frf, options);
  trial.limit.reset();
  // In a search that ended early, poles have not converged.
  FitOptions with_deviations = trial;
  with_deviations.uncertainty = true;
  with_deviations.response_variance = false;
  const FitResult same = fit_additive_model(frf, fit.model, with_deviations);
  advice = better_structure(frf, options, trial, same, cut_short);
  if (advice.empty()) advice = better_band(frf, trial, same);
  if (!advice.empty()) return advice;
  return "No other structure fits better: give the number of modes with --modes N";
}

std::string limit_message(const FrfEstimate& frf, const FitOptions& options, const FitResult& fit) {
  if (options.limit->was_interrupted() || fit.status() == FitStatus::singular)
    return options.limit->message();
  const double budget_s = options.limit->budget_s();
  return fmt::format(
      "the search reached its budget of {:.6g} s at {}. {}; continue with --search-seconds {:.6g}",
      budget_s, counted(count_modes(fit.model), "mode"), advice_for(frf, options, fit, true),
      kMoreBudget * budget_s);
}

}  // namespace stageid
