#include "estimation/search/growth.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include "estimation/fit/fit_verdict.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/search/search_moves.hpp"

namespace stageid {
namespace {

bool wanted_more(const SearchState& state) {
  const int modes = count_modes(state.best.model);
  if (state.selection.exactly > 0) return modes < state.target;
  return modes < state.affordable_modes() && state.may_overtake() && !state.at_rounding() &&
         state.delay_denied.empty() && !state.limit_reached();
}

FitResult fit_with(const SearchState& state, const std::vector<ProposedMode>& more) {
  AdditiveModel model = state.best.model;
  for (const ProposedMode& candidate : more)
    model.submodels.push_back(mode_submodel(state.frf, state.structure, candidate.mode));
  return fit_additive_model(state.frf, model, state.quick);
}

/// Whether the modes that `trial` has beside those of the model are worth their parameters, and none is fitted to one
/// line, as outliers are: it is not narrower than the lines, and other lines than the best one confirm it.
bool is_worth_adding(const SearchState& state, const FitResult& trial) {
  if (!state.is_better(trial)) return false;
  for (std::size_t i = state.best.model.submodels.size(); i < trial.model.submodels.size(); ++i)
    if (trial.model.submodels[i].damping_ratio() < kBroad &&
        mode_verdict(state.frf, ModeNumber::chosen, trial, i) == ModeVerdict::at_bound)
      return false;
  const Team& team = *state.quick.workers().team;
  Eigen::VectorXd gain =
      squares_of_lines(state.frf, state.best.model, state.quick.user_weights, team) -
      squares_of_lines(state.frf, trial.model, state.quick.user_weights, team);
  const auto added =
      static_cast<Eigen::Index>(trial.model.submodels.size() - state.best.model.submodels.size());
  std::ranges::sort(gain);
  return gain.head(std::max<Eigen::Index>(0, gain.size() - added)).sum() >
         static_cast<double>(added) * state.worth.most_by_chance(trial);
}

/// Adds several at once if each is clearly worth it; pruning corrects surplus ones. If very many are requested,
/// regardless of their worth.
bool add_clear_ones(SearchState& state, const std::vector<ProposedMode>& candidates) {
  const bool demanded = state.selection.exactly > 0;
  std::vector<ProposedMode> clear;
  for (const ProposedMode& candidate : candidates)
    if (demanded || candidate.gain > 4.0 * state.worth.price(state.best))
      clear.push_back(candidate);
  const int room = (state.selection.exactly > 0 ? state.target : state.affordable_modes()) -
                   count_modes(state.best.model);
  if (room < static_cast<int>(clear.size())) clear.resize(static_cast<std::size_t>(room));
  if (clear.size() < 2) return false;
  FitResult trial = fit_with(state, clear);
  if (demanded ? trial.status() == FitStatus::singular : !is_worth_adding(state, trial))
    return false;
  for (const ProposedMode& candidate : clear)
    state.say("added {:.6g} Hz, one of {} added together: cost {:.6g} -> {:.6g}",
              candidate.mode.frequency_hz, clear.size(), state.cost(), trial.model.fit.cost);
  state.adopt(std::move(trial));
  return true;
}

bool add_one(SearchState& state, const std::vector<ProposedMode>& candidates) {
  FitResult best_trial;
  bool found = false;
  bool worth_it = false;
  const double price = state.worth.price(state.best);
  double reach = kReach;
  for (const ProposedMode& candidate : candidates) {
    if (state.selection.exactly == 0 && reach * candidate.gain < price) continue;
    FitResult trial = fit_with(state, {candidate});
    if (trial.status() == FitStatus::singular) continue;
    const double gain =
        static_cast<double>(state.frf.lines()) * (state.cost() - trial.model.fit.cost);
    reach = 2.0 * std::max(1.0, gain / candidate.gain);  // as the last one, with a margin
    worth_it = is_worth_adding(state, trial);
    if (worth_it || !found || trial.model.fit.cost < best_trial.model.fit.cost)
      best_trial = std::move(trial);
    found = true;
    // The first candidate is usually right; the others are tried only if it is not worth its parameters.
    if (worth_it || state.limit_reached()) break;
  }
  if (!found) {
    state.say(
        "no further mode: no candidate in the weighted residual justifies the parameters of a "
        "mode (BIC)");
    return false;
  }
  const Submodel& added = best_trial.model.submodels.back();
  if (state.selection.exactly == 0 && !worth_it) {
    state.say(
        "no further mode: the best candidate, {:.6g} Hz, would lower the cost by {:.2g} %, "
        "{}",
        added.natural_frequency_hz(), 100.0 * (1.0 - best_trial.model.fit.cost / state.cost()),
        state.is_better(best_trial) ? "but only on one line, as an outlier does"
                                    : "which does not justify its parameters (BIC)");
    return false;
  }
  state.say("added {:.6g} Hz (damping {:.3g}): cost {:.6g} -> {:.6g}", added.natural_frequency_hz(),
            added.damping_ratio(), state.cost(), best_trial.model.fit.cost);
  state.adopt(std::move(best_trial));
  return true;
}

/// Whether the squares rise by no more than the removal costs of these modes together. They rise by more if two of
/// them described the same resonance.
bool is_predicted(const SearchState& state, const FitResult& without,
                  const std::vector<std::size_t>& out) {
  double predicted = 0.0;
  for (const std::size_t i : out) predicted += state.best.removal_cost[i];
  const double lines = static_cast<double>(state.frf.lines());
  return 2.0 * lines * (without.model.fit.cost - state.cost()) <= predicted;
}

/// Drops modes that are not worth their parameters, several at a time, or one by one if that fails.
void prune(SearchState& state) {
  std::size_t at_once = state.best.model.submodels.size();
  while (count_modes(state.best.model) > 1 && at_once > 0) {
    const int surplus =
        state.selection.exactly > 0 ? count_modes(state.best.model) - state.selection.exactly : 0;
    if (state.selection.exactly > 0 && surplus <= 0) return;
    // A refit regains part of the removal cost, so the limit is twice the price here, and BIC decides afterwards.
    const double limit =
        surplus > 0 ? std::numeric_limits<double>::infinity() : 2.0 * state.worth.price(state.best);
    const std::size_t most =
        surplus > 0 ? std::min(at_once, static_cast<std::size_t>((surplus + 1) / 2)) : at_once;
    const std::vector<std::size_t> out = least_worthy(state.best, limit, most);
    if (out.empty()) return;
    AdditiveModel model = state.best.model;
    for (std::size_t n = out.size(); n-- > 0;)
      model.submodels.erase(model.submodels.begin() + static_cast<std::ptrdiff_t>(out[n]));
    FitResult without = fit_additive_model(state.frf, model, state.quick);
    const bool worse = surplus > 0 ? out.size() > 1 && !is_predicted(state, without, out)
                                   : !state.is_better(without);
    if (worse) {
      at_once = out.size() / 2;
      continue;
    }
    for (const std::size_t i : out)
      state.say("dropped {:.6g} Hz: cost {:.6g} -> {:.6g}",
                state.best.model.submodels[i].natural_frequency_hz(), state.cost(),
                without.model.fit.cost);
    state.adopt(std::move(without));
    at_once *= 2;
  }
}

}  // namespace

bool grow(SearchState& state) {
  bool grown = false;
  if (state.history.size() == state.exhausted_at || !state.delay_denied.empty()) return false;
  for (int round = 0; wanted_more(state); ++round) {
    if (state.selection.exactly == 0 && std::has_single_bit(static_cast<unsigned>(round))) {
      if (restructure(state)) reduce(state);
      if (round > 1 && a_delay_explains_more(state)) break;
    }
    const std::vector<ProposedMode>& candidates = state.proposals();
    if (!add_clear_ones(state, candidates) && !add_one(state, candidates)) break;
    grown = true;
  }
  state.exhausted_at = state.history.size();
  return grown;
}

void reduce(SearchState& state) {
  prune(state);
  if (state.selection.exactly == 0) merge(state);
}

}  // namespace stageid
