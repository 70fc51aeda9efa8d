#include "estimation/search/search_start.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/search/trials.hpp"
#include "estimation/start/pole_relocation.hpp"

namespace stageid {
namespace {

/// Fits with all poles free as long as that halves the cost: those of modes hidden by noise never settle.
void settle(SearchState& state) {
  FitOptions while_free = state.quick;
  while_free.max_iterations = std::min(kIterationsWhileFree, state.options.max_iterations);
  for (double before = HUGE_VAL;
       state.cost() < 0.5 * before && !state.at_rounding() && !state.limit_reached();) {
    before = state.cost();
    FitResult free = fit_additive_model(state.frf, state.best.model, while_free);
    if (free.status() == FitStatus::singular) return;
    state.adopt(std::move(free));
  }
}

}  // namespace

AdditiveModel start_model(SearchState& state) {
  std::vector<ModeCandidate> modes = state.selection.modes;
  if (modes.empty() && !state.selection.keep_modes) {
    modes =
        without_given(guess_from(state.frf, [](const FrfEstimate& frf) { return pick_modes(frf); }),
                      state.structure);
    const std::size_t most = static_cast<std::size_t>(state.affordable_modes());
    if (modes.size() > most) modes.resize(most);
    state.say("start: {} of the CMIF", counted(modes.size(), "peak"));
  } else {
    state.say("start: {} given", counted(modes.size(), "mode"));
  }
  AdditiveModel model = state.start_of(modes);
  if (model.submodels.empty()) {
    Eigen::Index k = 0;
    guess_from(state.frf, [](const FrfEstimate& frf) { return cmif(frf, CmifKind::accelerance); })
        .row(0)
        .maxCoeff(&k);
    model.submodels.push_back(
        mode_submodel(state.frf, state.structure, {state.frf.frequency_hz[k], 0.01, 1}));
  }
  return model;
}

void begin_placed(SearchState& state) {
  // Pole relocation needs the delay.
  if (state.options.delay != DelayModel::fixed)
    state.adopt(fit_additive_model(state.frf, start_model(state), state.quick));
  AdditiveModel model = state.start_of({});
  const auto wanted = static_cast<std::size_t>(state.selection.exactly);
  const std::vector<ModeCandidate> modes =
      relocate_poles(state.frf, model, state.quick.user_weights, wanted, state.quick.workers());
  state.say("start: {} by pole relocation", counted(modes.size(), "mode"));
  FitOptions still = state.quick;
  still.max_iterations = 0;
  state.adopt(fit_additive_model(state.frf, state.start_of(modes), still));
  settle(state);
}

void begin_open(SearchState& state, const AdditiveModel& model) {
  state.start = model;
  state.adopt(fit_additive_model(state.frf, model, state.quick));
  if (state.limit_reached()) return;
  const auto modes = static_cast<std::size_t>(count_modes(state.best.model));
  const AdditiveModel relocated = state.start_of(relocate_poles(
      state.frf, state.best.model, state.quick.user_weights, modes, state.quick.workers()));
  FitResult fit = fit_additive_model(state.frf, relocated, state.quick);
  if (!state.is_better(fit)) return;
  state.say("pole relocation: cost {:.6g} -> {:.6g}", state.cost(), fit.model.fit.cost);
  state.adopt(std::move(fit));
}

}  // namespace stageid
