#include "estimation/search/search_moves.hpp"

#include <algorithm>
#include <utility>

#include "estimation/fit/overlapping_modes.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "estimation/problem/fit_start.hpp"
#include "estimation/search/structure_moves.hpp"
#include "estimation/search/trials.hpp"

namespace stageid {
namespace {

/// A part of the data, on which moves are tried, and the score that the model has on all lines according to it.
struct Sample {
  explicit Sample(const SearchState& state)
      : data(part_of_data(state.frf, state.quick, state.best.model)),
        worth(data.frf, state.structure, data.options.user_weights, state.frf.lines()) {
    FitResult fit = fit_additive_model(data.frf, data.model, data.options);
    if (!data.all && worth.at_rounding(fit) && !state.at_rounding()) {
      // Rounding decides nothing.
      data = {state.frf, state.quick, state.best.model, true};
      worth = state.worth;
      fit = fit_additive_model(data.frf, data.model, data.options);
    }
    now = worth.criterion(fit);
  }
  PartOfData data;
  ModeWorth worth;
  double now = 0.0;  ///< criterion
};

/// A fit that gives up early if it does not reach a criterion.
FitResult tried(const FrfEstimate& frf, const ModeWorth& worth, double criterion,
                const AdditiveModel& model, FitOptions options) {
  const FitProblem problem = make_problem(frf, model, options, options.user_weights);
  options.worthwhile_cost = worth.cost_at(criterion, model, problem.parameters());
  return fit_additive_model(frf, model, options);
}

/// @returns false if all data do not confirm the move
bool take(SearchState& state, const StructureMove& move, FitResult&& fit, bool all) {
  FitOptions options = state.quick;
  options.delay = move.options.delay;
  options.delay_s = move.options.delay_s;
  if (!all)
    fit = tried(state.frf, state.worth, state.score(), with_all_channels(state.frf, fit.model),
                options);
  if (!state.is_better(fit)) return false;
  state.say("{}: cost {:.6g} -> {:.6g}, {} -> {} parameters", move.flag, state.cost(),
            fit.model.fit.cost, state.best.parameters, fit.parameters);
  state.take_delay_of(options);
  state.adopt(std::move(fit));
  return true;
}

/// Ranks the moves by trial on the sample and takes the first that all data confirm.
bool take_best(SearchState& state, const Sample& sample, std::vector<StructureMove> moves) {
  struct Better {
    double criterion;
    StructureMove move;
    FitResult fit;
  };
  std::vector<Better> better;
  for (StructureMove& move : moves) {
    FitResult trial = tried(sample.data.frf, sample.worth, sample.now, move.model, move.options);
    const double then = sample.worth.criterion(trial);
    if (trial.status() == FitStatus::singular || !(then < sample.now)) continue;
    better.push_back({then, std::move(move), std::move(trial)});
  }
  std::stable_sort(better.begin(), better.end(),
                   [](const Better& a, const Better& b) { return a.criterion < b.criterion; });
  return std::any_of(better.begin(), better.end(), [&](Better& ranked) {
    return take(state, ranked.move, std::move(ranked.fit), sample.data.all);
  });
}

/// @returns false if no change is better
bool change_structure(SearchState& state) {
  const Sample sample(state);
  std::vector<StructureMove> moves = structure_moves(sample.data.frf, sample.data.options,
                                                     sample.data.model, state.structure.open);
  std::erase_if(moves, [&](const StructureMove& move) {
    return count_modes(move.model) <
           std::min(state.selection.exactly, count_modes(state.best.model));
  });
  for (StructureMove& move : moves) move.flag.insert(0, "structure: ");
  if (!take_best(state, sample, std::move(moves))) return false;
  const bool was_proportional = !state.structure.general_damping;
  state.take_structure_of(state.best.model);
  if (was_proportional && state.structure.general_damping)
    state.proportional = std::move(state.before);
  return true;
}

}  // namespace

bool restructure(SearchState& state) {
  bool changed = false;
  if (state.structure.open == OpenStructure{} || state.history.size() == state.structured_at ||
      !state.delay_denied.empty())
    return false;
  while (!state.limit_reached() && state.may_overtake() && change_structure(state)) changed = true;
  state.structured_at = state.history.size();
  return changed;
}

void merge(SearchState& state) {
  while (!state.limit_reached() && state.history.size() != state.merged_at) {
    if (overlapping_modes(state.best.model).empty()) return;
    const Sample sample(state);
    const std::vector<StructureMove> all = merges(sample.data.options, sample.data.model);
    const std::vector<DataRange> some = ranges_of(std::ssize(all), kTried);
    if (std::none_of(some.begin(), some.end(), [&](DataRange range) {
          const auto first = all.begin() + range.first;
          return take_best(state, sample, {first, first + range.count});
        }))
      state.merged_at = state.history.size();
  }
}

bool a_delay_explains_more(SearchState& state) {
  if (state.options.delay != DelayModel::fixed || state.start.submodels.empty() || !state.simple ||
      !(state.cost() < state.simple->model.fit.cost))
    return false;
  if (!state.delayed) {
    FitOptions options = state.quick;
    options.delay = DelayModel::estimate;
    options.delay_s = 0.0;  // 0 starts the search for a delay; a wrong value would not
    options.max_iterations = state.options.max_iterations;
    AdditiveModel model = state.start;  // a fit with a wrong delay has moved the poles
    model.input_delay_s.resize(0);
    model.output_delay_s.resize(0);
    state.delayed = fit_additive_model(state.frf, model, options);
  }
  const FitResult& trial = *state.delayed;
  if (!state.is_better(trial)) return false;
  state.delay_denied = fmt::format(
      "a delay of {:.4g} s instead of {:.4g} s fits better (squared residual {:.6g}) than more "
      "modes or another structure ({:.6g}), which were discarded; use --delay estimate",
      trial.model.mean_delay_s(), state.options.delay_s, trial.model.fit.cost, state.cost());
  state.say("{}", state.delay_denied);
  state.best = *state.simple;
  state.take_structure_of(state.best.model);
  return true;
}

}  // namespace stageid
