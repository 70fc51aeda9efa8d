#include "estimation/search/search_state.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/fit/search_constants.hpp"
#include "estimation/search/trials.hpp"

namespace stageid {

SearchState::SearchState(const FrfEstimate& of_frf, const ModelStructure& of_model,
                         const ModeSelection& of_modes, const FitOptions& of_fit)
    : frf(of_frf),
      selection(of_modes),
      structure(of_model),
      options(of_fit),
      quick(trial_options(of_frf, of_fit)),
      worth(of_frf, of_model, quick.user_weights),
      target(of_modes.exactly) {
  quick.deviation_tolerance = worth.deviation_tolerance();
}

bool SearchState::is_better(const FitResult& fit) const {
  return fit.status() != FitStatus::singular && worth.criterion(fit) < score();
}

void SearchState::adopt(FitResult&& result) {
  before = std::exchange(best, std::move(result));
  history.insert(history.end(), best.cost.begin(), best.cost.end());
}

void SearchState::take_structure_of(const AdditiveModel& model) {
  const OpenStructure open = structure.open;
  structure = structure_of(with_all_channels(frf, model));
  structure.open = open;
  worth = ModeWorth(frf, structure, quick.user_weights);
}

void SearchState::take_delay_of(const FitOptions& fit) {
  quick.delay = options.delay = fit.delay;
  quick.delay_s = options.delay_s = fit.delay_s;
}

const std::vector<ProposedMode>& SearchState::proposals() {
  const std::size_t together =
      std::max(kTried, static_cast<std::size_t>(count_modes(best.model)) / kShareAtOnce);
  if (std::exchange(proposed_at_, history.size()) != history.size())
    proposed_ = proposed_modes(frf, best.model, quick.user_weights, together, quick.workers());
  return proposed_;
}

std::optional<ModeCandidate> SearchState::missing_mode() {
  const std::vector<ProposedMode>& missed = proposals();
  if (missed.empty() || kReach * missed.front().gain <= worth.price(best)) return std::nullopt;
  return missed.front().mode;
}

bool SearchState::may_overtake() const {
  if (!race) return true;
  const auto left = static_cast<double>(race->rival->parameters - best.parameters);
  const auto used = static_cast<double>(best.parameters - race->parameters);
  const double gained = std::log(race->cost / cost());
  const double behind = std::log(cost() / race->rival->model.fit.cost);
  return left > 0.0 && behind * used <= 2.0 * gained * left;
}

AdditiveModel SearchState::start_of(const std::vector<ModeCandidate>& modes) const {
  AdditiveModel model;
  model.hold = options.hold;
  if (!best.model.submodels.empty()) {
    model.input_delay_s = best.model.input_delay_s;
    model.output_delay_s = best.model.output_delay_s;
  } else if (options.delay == DelayModel::fixed) {
    model.input_delay_s.setConstant(frf.n_inputs(), options.delay_s);
    model.output_delay_s.setZero(frf.n_outputs());
  }
  model.submodels = fixed_submodels(frf, structure);
  for (const ModeCandidate& mode : modes) {
    Submodel& s = model.submodels.emplace_back(mode_submodel(frf, structure, mode));
    // The lines show only the asymptote of a pole an octave beside them; free, it would go to a noise peak.
    const bool is_far_beside = 2.0 * mode.frequency_hz < frf.frequency_hz[0] ||
                               mode.frequency_hz > 2.0 * frf.frequency_hz[frf.lines() - 1];
    if (selection.keep_modes && is_far_beside) s.held = HeldPole::pole;
  }
  return model;
}

}  // namespace stageid
