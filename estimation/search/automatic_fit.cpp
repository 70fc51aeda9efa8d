#include "estimation/search/automatic_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "estimation/fit/hidden_modes.hpp"
#include "estimation/fit/ranked_fit.hpp"
#include "estimation/fit/residue_ranks.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/search/growth.hpp"
#include "estimation/search/search_advice.hpp"
#include "estimation/search/search_moves.hpp"
#include "estimation/search/search_start.hpp"
#include "estimation/search/search_state.hpp"
#include "estimation/search/structure_moves.hpp"
#include "estimation/search/trials.hpp"

namespace stageid {
namespace {

ModeNumber mode_number(const SearchState& state) {
  if (state.selection.keep_modes) return ModeNumber::given;
  return state.selection.exactly > 0 ? ModeNumber::asked : ModeNumber::chosen;
}

/// Whether only the number of modes is requested.
bool is_placed(const SearchState& state) {
  return state.selection.exactly > 0 && state.selection.modes.empty() &&
         !state.selection.keep_modes;
}

/// Whether that mode is beside the lines. Every structure imitates such modes, so they are added first.
bool misses_mode_beside_lines(SearchState& state) {
  const std::optional<ModeCandidate> mode = state.missing_mode();
  return mode && side_of_lines(state.frf, mode->frequency_hz) != 0;
}

/// Newton decrement at which every free pole is within kSettled of its standard deviation.
double settled(const SearchState& state) {
  double free = 0.0;
  for (const Submodel& submodel : state.best.model.submodels)
    if (is_searched_mode(submodel) && submodel.held == HeldPole::none) free += 2.0;
  return kSettled * std::sqrt(free);
}

void hold_hidden(SearchState& state) {
  state.hidden =
      hold_hidden_modes(state.frf, state.quick.user_weights, state.quick.threads, state.best);
  if (state.hidden > 0)
    state.say("noise hides {} of {}; their poles are held", state.hidden,
              counted(count_modes(state.best.model), "mode"));
}

/// Whether modes may be misplaced: the residual still shows one.
bool may_exchange(SearchState& state) {
  return state.selection.exactly > 0 && !state.selection.keep_modes &&
         state.selection.exactly < state.affordable_modes() &&
         state.best.status() != FitStatus::singular && !state.at_rounding() &&
         !state.limit_reached() && state.missing_mode();
}

/// @param surplus modes to grow beyond the requested number
void search(SearchState& state, int surplus) {
  state.target = state.selection.exactly + surplus;
  if (surplus > 0) state.target = std::min(state.target, state.affordable_modes());
  if (state.best.status() == FitStatus::singular || state.selection.keep_modes) return;
  if (!state.delay_denied.empty()) return;
  // Two modes on one peak prevent convergence, and their residual looks like more modes.
  if (state.selection.exactly == 0) {
    reduce(state);
    if (!state.simple) state.simple = state.best;
    if (!misses_mode_beside_lines(state) && restructure(state)) reduce(state);
  }
  grow(state);
  if (surplus > 0) restructure(state);
  reduce(state);
  if (state.selection.exactly == 0) {
    for (bool changed = restructure(state); grow(state) || changed; changed = restructure(state))
      reduce(state);
    a_delay_explains_more(state);
    return;
  }
  if (!state.at_rounding()) hold_hidden(state);
  restructure(state);
  if (!state.at_rounding()) {  // else the last fit is sufficient
    FitOptions last = state.quick;
    last.max_iterations = state.options.max_iterations;
    last.deviation_tolerance = settled(state);
    state.adopt(fit_additive_model(state.frf, state.best.model, last));
  }
  state.say("{}, reached by way of {}: cost {:.6g}", counted(count_modes(state.best.model), "mode"),
            state.target, state.cost());
}

/// Decides between general and proportional damping. A model with general damping can describe what a few missing
/// modes, or delays, cause, and then these are not found. So the search continues with proportional damping as long as
/// its model may become the better one. A requested number leaves no room for further modes.
void settle_damping(std::optional<SearchState>& state) {
  if (!state->structure.open.general_damping || !state->structure.general_damping ||
      state->selection.exactly > 0)
    return;
  state->structure.open.general_damping = false;
  SearchState other = *state;
  const StructureMove proportional = proportional_damping(other.quick, other.best.model);
  other.say("{} once more", proportional.flag);
  other.adopt(fit_additive_model(other.frf, proportional.model, other.quick));
  if (other.proportional.model.fit.cost < other.cost()) other.adopt(FitResult(other.proportional));
  other.take_structure_of(other.best.model);
  other.race = {&state->best, other.cost(), other.best.parameters};
  search(other, 0);
  other.race.reset();
  if (other.worth.criterion_of_structure(other.frf, other.best) <
      other.worth.criterion_of_structure(other.frf, state->best))
    state.emplace(std::move(other));
}

/// The whole search on a part of the data; then a fit of its result to all data.
/// @returns false if the data are too few for a part
bool begin_on_part(SearchState& state, const AdditiveModel& model) {
  const PartOfData part = part_of_data(state.frf, state.quick, model);
  if (part.all) return false;
  ModelStructure structure = state.structure;
  structure.given = structure_of(part.model).given;
  std::optional<SearchState> of_part(std::in_place, part.frf, structure, state.selection,
                                     part.options);
  begin_open(*of_part, part.model);
  search(*of_part, 0);
  settle_damping(of_part);
  if (of_part->best.status() == FitStatus::singular) return false;
  for (const std::string& decision : of_part->decisions)
    state.say("{} of {} lines: {}", part.frf.lines(), state.frf.lines(), decision);
  state.take_delay_of(of_part->options);
  state.structure.open = of_part->structure.open;
  state.take_structure_of(of_part->best.model);
  state.delay_denied = std::move(of_part->delay_denied);
  state.adopt(fit_additive_model(state.frf, with_all_channels(state.frf, of_part->best.model),
                                 state.quick));
  return true;
}

/// The first fit of every search. A search for the number of modes begins on a part of the data; a requested number
/// is placed at once.
void begin(SearchState& state) {
  if (is_placed(state)) return begin_placed(state);
  const AdditiveModel model = start_model(state);
  if (state.selection.exactly > 0 || state.selection.keep_modes)
    state.adopt(fit_additive_model(state.frf, model, state.quick));
  else if (!begin_on_part(state, model))
    begin_open(state, model);
}

FitResult finish(SearchState& state, FitEvidence& evidence) {
  state.quick.user_weights = {};  // the last fit computes its own
  sort_modes(state.best);
  const bool cut_short = state.limit_reached();
  state.options.limit->begin_completion();
  FitOptions last = state.options;
  last.judge_modes = state.selection.keep_modes;
  last.shrink_hidden = state.hidden > 0;
  if (state.hidden > 0)
    last.deviation_tolerance = std::max(last.deviation_tolerance, settled(state));
  evidence.number = mode_number(state);
  FitResult result = ranked_fit(state.frf, state.best.model, last, evidence);
  if (const std::string ranks = describe(result.residue_ranks); !ranks.empty())
    result.decisions.push_back(ranks);
  sort_modes(result);
  if (state.selection.exactly > 0 && state.options.residue_rank == 0 && result.trustworthy() &&
      supports_all_modes(state.frf, evidence, result))
    evidence.alike = alike_modes(state.frf, last, result);
  evidence.delay_denied = state.delay_denied;
  if (cut_short) evidence.limit = limit_reason(state.frf, state.options, result);
  state.decisions.insert(state.decisions.end(), result.decisions.begin(), result.decisions.end());
  result.decisions = std::move(state.decisions);
  result.cost.insert(result.cost.begin(), state.history.begin(), state.history.end());
  result.model.cost_history = result.cost;
  result.model.fit.iterations = static_cast<int>(result.cost.size()) - 1;
  return result;
}

}  // namespace

FitResult automatic_fit(const FrfEstimate& frf, const ModelStructure& structure,
                        const ModeSelection& selection, const FitOptions& asked) {
  FitEvidence evidence;
  FitResult fit = searched_fit(frf, structure, selection, asked, evidence);
  judge(frf, evidence, fit);
  return fit;
}

FitResult searched_fit(const FrfEstimate& frf, const ModelStructure& structure,
                       const ModeSelection& selection, const FitOptions& asked,
                       FitEvidence& evidence) {
  check(frf);
  if (selection.exactly < 0)
    throw std::invalid_argument("fit: the number of modes must be positive");
  const Eigen::Index most = most_modes(frf, structure);
  if (selection.exactly > most || selection.modes.size() > static_cast<std::size_t>(most))
    throw std::invalid_argument(fmt::format(
        "fit: {} lines are too few for {} modes; request at most {}", frf.lines(),
        std::max<std::size_t>(static_cast<std::size_t>(selection.exactly), selection.modes.size()),
        most));
  FitOptions options = asked;
  options.limit = search_limit(selection, asked);
  std::optional<SearchState> best(std::in_place, frf, structure, selection, options);
  begin(*best);
  search(*best, 0);
  settle_damping(best);
  // Misplaced modes are exchanged: more are added at the peaks of the residual, and the least worthy are dropped.
  const int fifth = 1 + selection.exactly / static_cast<int>(kShareAtOnce);
  const int most_surplus = std::max(static_cast<int>(kTried), fifth);
  for (int surplus = fifth; surplus <= most_surplus && may_exchange(*best);) {
    SearchState other = *best;
    search(other, surplus);
    // Clearly below: by what one mode costs.
    if (!(other.score() < best->score() - best->worth.cost_of_one())) surplus *= 2;
    if (other.score() < best->score()) best.emplace(std::move(other));
  }
  return finish(*best, evidence);
}

std::shared_ptr<SearchLimit> search_limit(const ModeSelection& selection,
                                          const FitOptions& options) {
  if (options.limit) return options.limit;
  const bool open = selection.exactly == 0 && !selection.keep_modes;
  return std::make_shared<SearchLimit>(open ? selection.search_seconds : 0.0, options.interrupted);
}

}  // namespace stageid
