#include "estimation/fit/settled_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/fit/mode_worth.hpp"
#include "estimation/fit/overlapping_modes.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/search_limit.hpp"

namespace stageid {
namespace {

/// The submodel with the least determined pole; none if all are determined.
std::optional<std::size_t> least_determined(const FitResult& fit, SubmodelRole role) {
  std::optional<std::size_t> out;
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i)
    if (fit.model.submodels[i].role == role && pole_doubt(fit, i) >= 1.0 &&
        (!out || pole_doubt(fit, i) > pole_doubt(fit, *out)))
      out = i;
  return out;
}

struct Simpler {
  AdditiveModel model;
  std::string reason;
};

Simpler without(const AdditiveModel& model, std::size_t i, const std::string& doubt) {
  Simpler out{model, fmt::format("removed {:.6g} Hz, which the data do not support {}",
                                 model.submodels[i].natural_frequency_hz(), doubt)};
  out.model.submodels.erase(out.model.submodels.begin() + static_cast<std::ptrdiff_t>(i));
  return out;
}

Simpler with_held(const AdditiveModel& model, std::size_t i, const std::string& doubt) {
  Simpler out{model,
              fmt::format("held the pole at {:.6g} Hz, which the data need but do not determine {}",
                          model.submodels[i].natural_frequency_hz(), doubt)};
  out.model.submodels[i].held = HeldPole::guess;
  return out;
}

/// Simpler models: without one of two modes that converged to each other, else without the least determined mode; then
/// with the pole of that mode held, of a pair only if it is beside the lines. Empty: all modes are determined.
std::vector<Simpler> simpler(const FitResult& fit) {
  const AdditiveModel& model = fit.model;
  if (const auto pair = coincident_pair(model)) {
    const auto [i, j] = *pair;
    const double one_hz = model.submodels[i].natural_frequency_hz();
    const double other_hz = model.submodels[j].natural_frequency_hz();
    std::vector<Simpler> out = {
        {with_one_of(model, i, j),
         fmt::format("merged {:.6g} and {:.6g} Hz, which coincided and", one_hz, other_hz)}};
    const double* band_hz = model.fit.band_hz;
    if (std::max(one_hz, other_hz) < band_hz[0] || std::min(one_hz, other_hz) > band_hz[1])
      out.push_back(with_held(model, pole_doubt(fit, i) > pole_doubt(fit, j) ? i : j,
                              "(another mode is as near as its standard deviation) and which"));
    return out;
  }
  const std::optional<std::size_t> open = least_determined(fit, SubmodelRole::searched);
  if (!open) return {};
  const double times = pole_doubt(fit, *open);
  const std::string doubt =
      std::isfinite(times)
          ? fmt::format("(standard deviation {:.2g} times its value) and which", times)
          : "(at its bound) and which";
  return {without(model, *open, doubt), with_held(model, *open, doubt)};
}

bool may_converge(const FitResult& fit) {
  return fit.status() == FitStatus::iteration_limit || fit.status() == FitStatus::cost_stalled;
}

/// Removes modes that the data do not determine, one by one, if they are not worth their parameters.
void leave_out_undetermined(const FrfEstimate& frf, const FitOptions& options, FitResult& fit,
                            std::vector<std::string>& said) {
  const ModeWorth worth(frf);
  const auto is_better_without = [&](std::size_t i) {
    const ModeVerdict verdict = mode_verdict(frf, ModeNumber::chosen, fit, i);
    if (verdict != ModeVerdict::weak && verdict != ModeVerdict::at_bound) return false;
    AdditiveModel fewer = fit.model;
    fewer.submodels.erase(fewer.submodels.begin() + static_cast<std::ptrdiff_t>(i));
    FitResult trial = fit_additive_model(frf, fewer, options);
    if (!trial.trustworthy() || !(worth.criterion(trial) < worth.criterion(fit))) return false;
    said.push_back(fmt::format(
        "removed {:.6g} Hz (damping {:.3g}), which the data do not support and which does not "
        "justify its parameters (BIC): cost {:.6g} -> {:.6g}",
        fit.model.submodels[i].natural_frequency_hz(), fit.model.submodels[i].damping_ratio(),
        fit.model.fit.cost, trial.model.fit.cost));
    fit = std::move(trial);
    return true;
  };
  for (std::size_t i = 0; i < fit.model.submodels.size();) {
    if (count_modes(fit.model) < 2 || (options.limit && options.limit->reached())) return;
    i = is_better_without(i) ? 0 : i + 1;
  }
}

/// Makes the model simpler until a fit converges; returns the first fit if none does.
FitResult converged_fit(const FrfEstimate& frf, const AdditiveModel& start,
                        const FitOptions& options, std::vector<std::string>& said) {
  FitResult first = fit_additive_model(frf, start, options);
  if (!may_converge(first)) return first;
  const ModeWorth worth(frf);
  FitResult fit = first;
  std::vector<std::string> steps;
  while (may_converge(fit) && count_modes(fit.model) > 1) {
    const std::vector<Simpler> models = simpler(fit);
    if (models.empty()) break;
    FitResult next = fit_additive_model(frf, models[0].model, options);
    std::size_t chosen = 0;
    // A mode beside the lines may be needed although its pole is undetermined.
    if (models.size() > 1 && worth.criterion(next) > worth.criterion(fit)) {
      FitResult held = fit_additive_model(frf, models[1].model, options);
      if (worth.criterion(held) < worth.criterion(next)) {
        next = std::move(held);
        chosen = 1;
      }
    }
    if (!(next.model.fit.cost < kDearest * first.model.fit.cost)) return first;
    steps.push_back(fmt::format("{} prevented the fit from converging: cost {:.6g} -> {:.6g}",
                                models[chosen].reason, fit.model.fit.cost, next.model.fit.cost));
    fit = std::move(next);
  }
  if (fit.status() == FitStatus::iteration_limit && simpler(fit).empty()) {
    FitOptions longer = options;
    longer.max_iterations *= kLonger;
    fit = fit_additive_model(frf, fit.model, longer);
  }
  if (!fit.trustworthy()) return first;
  said = std::move(steps);
  return fit;
}

/// Holds the frequencies of suspensions that the lines do not determine, the least determined first.
void hold_suspensions(const FrfEstimate& frf, const FitOptions& options, FitResult& fit,
                      std::vector<std::string>& said) {
  while (fit.status() != FitStatus::singular) {
    const std::optional<std::size_t> open = least_determined(fit, SubmodelRole::suspension);
    if (!open) return;
    AdditiveModel held = fit.model;
    Submodel& s = held.submodels[*open];
    const double doubt = pole_doubt(fit, *open);
    said.push_back(fmt::format(
        "suspension: the data do not support an estimate of the frequency of its mode "
        "at {:.4g} Hz{}; the frequency is held, without a standard deviation",
        s.natural_frequency_hz(),
        std::isfinite(doubt)
            ? fmt::format(" (standard deviation {:.2g} Hz)", doubt * s.natural_frequency_hz())
            : " (at its bound)"));
    s.held = HeldPole::frequency;
    fit = fit_additive_model(frf, held, options);
  }
}

}  // namespace

FitResult settled_fit(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options,
                      ModeNumber number) {
  std::vector<std::string> said;
  const bool chosen = number == ModeNumber::chosen;
  FitResult fit =
      chosen ? converged_fit(frf, start, options, said) : fit_additive_model(frf, start, options);
  if (chosen && fit.trustworthy()) leave_out_undetermined(frf, options, fit, said);
  hold_suspensions(frf, options, fit, said);
  fit.decisions.insert(fit.decisions.begin(), said.begin(), said.end());
  return fit;
}

}  // namespace stageid
