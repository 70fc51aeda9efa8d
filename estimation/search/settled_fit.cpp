#include "estimation/search/settled_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimation/model/model_structure.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/search/fit_additive_model.hpp"
#include "estimation/search/mode_worth.hpp"
#include "estimation/search/overlapping_modes.hpp"
#include "estimation/search/undetermined_modes.hpp"

namespace stageid {
namespace {

// Better determined modes do not prevent convergence.
constexpr double kLeastDoubt = 1.0;
constexpr double kUndoubtedWidths = 0.1;

// A model with this many times the cost does not follow the data: a fit that has not converged is better.
constexpr double kDearestMode = 1.5;

// Times the tolerance: a fit that ends by its number of iterations so near to the stationary point has converged if all
// its modes are determined. With the default tolerance, its error is a hundredth of a standard deviation.
constexpr double kNearly = 100.0;

struct OpenMode {
  std::size_t submodel = 0;
  double doubt = 0.0;  ///< larger of std(zeta)/zeta and std(f)/(zeta f); infinite at a bound
};

std::optional<OpenMode> most_open(const FitResult& fit) {
  std::optional<OpenMode> open;
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
    const Submodel& s = fit.model.submodels[i];
    if (!is_searched_mode(s) || s.frequency_held) continue;
    const double damping = s.damping_ratio();
    const double width_hz = damping * s.natural_frequency_hz();
    const double doubt = fit.is_held(i)
                             ? HUGE_VAL
                             : std::max(s.damping_ratio_std.value_or(0.0) / damping,
                                        s.natural_frequency_std_hz.value_or(0.0) / width_hz);
    if (doubt > (open ? open->doubt : kLeastDoubt)) open = {i, doubt};
  }
  return open;
}

/// Standard deviation of the frequency; if unknown, a part of the half-power width.
double doubt_hz(const Submodel& s) {
  const double width_hz = 2.0 * s.damping_ratio() * s.natural_frequency_hz();
  return s.natural_frequency_std_hz.value_or(kUndoubtedWidths * width_hz);
}

/// Two modes that converged to each other: closer than the deviation of either. Their limit is a double pole with
/// residues that grow without bound and cancel, so the parameters are undetermined.
std::optional<std::pair<std::size_t, std::size_t>> coalesced(const AdditiveModel& model) {
  for (const auto& [i, j] : overlapping_modes(model)) {
    const Submodel& one = model.submodels[i];
    const Submodel& other = model.submodels[j];
    if (one.frequency_held || other.frequency_held) continue;
    const double apart_hz = std::abs(one.natural_frequency_hz() - other.natural_frequency_hz());
    if (apart_hz < std::min(doubt_hz(one), doubt_hz(other))) return std::pair(i, j);
  }
  return std::nullopt;
}

struct Simpler {
  AdditiveModel model;
  std::string reason;
};

Simpler with_held(const AdditiveModel& model, std::size_t i, const std::string& doubt) {
  Simpler held{
      model, fmt::format("held the pole at {:.6g} Hz, which the data need but do not determine {}",
                         model.submodels[i].natural_frequency_hz(), doubt)};
  Submodel& mode = held.model.submodels[i];
  mode.frequency_held = mode.damping_held = true;
  return held;
}

/// Simpler models: without one of two modes that converged to each other, else without the least determined mode; then
/// with the pole of that mode held, of a pair only if it is beside the lines. Empty: all modes are determined.
std::vector<Simpler> simpler(const FitResult& fit) {
  const AdditiveModel& model = fit.model;
  if (const auto pair = coalesced(model)) {
    const auto [i, j] = *pair;
    const double one_hz = model.submodels[i].natural_frequency_hz();
    const double other_hz = model.submodels[j].natural_frequency_hz();
    std::vector<Simpler> out = {
        {with_one_of(model, i, j),
         fmt::format("merged {:.6g} and {:.6g} Hz, which coincided and", one_hz, other_hz)}};
    const double* band_hz = model.fit.band_hz;
    if (std::max(one_hz, other_hz) < band_hz[0] || std::min(one_hz, other_hz) > band_hz[1])
      out.push_back(with_held(model,
                              doubt_hz(model.submodels[i]) > doubt_hz(model.submodels[j]) ? i : j,
                              "(another mode is as near as its standard deviation) and which"));
    return out;
  }
  const std::optional<OpenMode> open = most_open(fit);
  if (!open) return {};
  const std::string doubt =
      std::isfinite(open->doubt)
          ? fmt::format("(standard deviation {:.2g} times its value) and which", open->doubt)
          : "(at its bound) and which";
  Simpler without{model,
                  fmt::format("removed {:.6g} Hz, which the data do not support {}",
                              model.submodels[open->submodel].natural_frequency_hz(), doubt)};
  without.model.submodels.erase(without.model.submodels.begin() +
                                static_cast<std::ptrdiff_t>(open->submodel));
  return {std::move(without), with_held(model, open->submodel, doubt)};
}

bool may_converge(const FitResult& fit) {
  return fit.status == FitStatus::iteration_limit || fit.status == FitStatus::cost_stalled;
}

/// Removes modes that the data do not determine, one by one, if they are not worth their parameters.
void leave_out_undetermined(const FrfEstimate& frf, const FitOptions& options, FitResult& fit,
                            std::vector<std::string>& left_out) {
  const auto without = [&](std::size_t i) {
    AdditiveModel fewer = fit.model;
    fewer.submodels.erase(fewer.submodels.begin() + static_cast<std::ptrdiff_t>(i));
    FitResult trial = fit_additive_model(frf, fewer, options);
    if (!trial.trustworthy() ||
        !(information_criterion(frf, trial) < information_criterion(frf, fit)))
      return false;
    left_out.push_back(fmt::format(
        "removed {:.6g} Hz (damping {:.3g}), which the data do not support and which does not "
        "justify its parameters (BIC): cost {:.6g} -> {:.6g}",
        fit.model.submodels[i].natural_frequency_hz(), fit.model.submodels[i].damping_ratio(),
        fit.model.fit.cost, trial.model.fit.cost));
    fit = std::move(trial);
    return true;
  };
  while (count_modes(fit.model) > 1 && !(options.limit && options.limit->reached())) {
    const std::vector<std::size_t> open = undetermined_modes(fit);
    if (std::none_of(open.begin(), open.end(), without)) return;
  }
}

/// Removes modes until a fit converges; returns the first fit if none does.
FitResult converged_fit(const FrfEstimate& frf, const AdditiveModel& start,
                        const FitOptions& options, std::vector<std::string>& left_out) {
  FitResult first = fit_additive_model(frf, start, options);
  if (!may_converge(first)) return first;
  FitResult fit = first;
  std::vector<std::string> given_up;
  while (may_converge(fit) && count_modes(fit.model) > 1) {
    const std::vector<Simpler> models = simpler(fit);
    if (models.empty()) break;
    FitResult next = fit_additive_model(frf, models[0].model, options);
    std::size_t chosen = 0;
    // A mode beside the lines may be needed although its pole is undetermined.
    if (models.size() > 1 && information_criterion(frf, next) > information_criterion(frf, fit)) {
      FitResult held = fit_additive_model(frf, models[1].model, options);
      if (information_criterion(frf, held) < information_criterion(frf, next)) {
        next = std::move(held);
        chosen = 1;
      }
    }
    if (!(next.model.fit.cost < kDearestMode * first.model.fit.cost)) return first;
    given_up.push_back(fmt::format("{} prevented the fit from converging: cost {:.6g} -> {:.6g}",
                                   models[chosen].reason, fit.model.fit.cost, next.model.fit.cost));
    fit = std::move(next);
  }
  if (!fit.trustworthy() && simpler(fit).empty() &&
      fit.deviations < kNearly * options.deviation_tolerance) {
    fit.status = FitStatus::gradient_small;
    fit.model.fit.status = to_string(fit.status);
    fit.model.fit.message.clear();
  }
  if (!fit.trustworthy()) return first;
  left_out = std::move(given_up);
  return fit;
}

}  // namespace

FitResult settled_fit(const FrfEstimate& frf, const AdditiveModel& start,
                      const FitOptions& options) {
  std::vector<std::string> left_out;
  FitResult fit = converged_fit(frf, start, options, left_out);
  if (fit.trustworthy()) leave_out_undetermined(frf, options, fit, left_out);
  fit.decisions.insert(fit.decisions.begin(), left_out.begin(), left_out.end());
  return fit;
}

}  // namespace stageid
