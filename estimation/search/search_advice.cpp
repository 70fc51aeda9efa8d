#include "estimation/search/search_advice.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/fit/mode_worth.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/model/cmif.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/search/proposed_modes.hpp"
#include "estimation/search/structure_moves.hpp"
#include "estimation/search/trials.hpp"

namespace stageid {
namespace {

constexpr double kMoreBudget = 4.0;  // factor for the next budget to try
constexpr double kNoiseOnly = 2.0;   // |G|^2 over its variance: the response is below the noise
constexpr double kMostLines = 0.5;
constexpr int kRounds = 4;  // of refits with missing modes
constexpr std::size_t kMostNamed = 8;

/// The names of inputs or outputs whose entries are all noise on most lines.
std::vector<std::string> silent_channels(const FrfEstimate& frf, bool inputs) {
  const Eigen::MatrixXd& variance =
      frf.noise_variance.size() > 0 ? frf.noise_variance : frf.total_variance;
  std::vector<std::string> names;
  if (variance.size() == 0) return names;
  const Eigen::Index count = inputs ? frf.n_inputs() : frf.n_outputs();
  Eigen::MatrixXd noisy(frf.response.rows(), 1);  // lines of every channel
  const auto [first, own] = frf.own();
  const auto power = frf.response.middleRows(first, own).cwiseAbs2().array();
  noisy.middleRows(first, own) = (power < kNoiseOnly * variance.middleRows(first, own).array())
                                     .rowwise()
                                     .count()
                                     .cast<double>()
                                     .matrix();
  frf.team->gather_rows(kTileChannels, noisy);
  const auto of_pair = noisy.reshaped(frf.n_outputs(), frf.n_inputs());
  const Eigen::VectorXd sums = inputs ? Eigen::VectorXd(of_pair.colwise().sum().transpose())
                                      : Eigen::VectorXd(of_pair.rowwise().sum());
  const double all = static_cast<double>(noisy.size() / count * frf.lines());
  for (Eigen::Index i = 0; i < count; ++i)
    if (sums[i] > kMostLines * all)
      names.push_back((inputs ? frf.inputs : frf.outputs).names[static_cast<std::size_t>(i)]);
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

/// The model with the modes that its residual shows, as long as each is worth its parameters.
/// @param together modes added by one refit
FitResult with_missing_modes(const FrfEstimate& frf, const FitOptions& trial, const FitResult& same,
                             int rounds, std::size_t together) {
  FitResult out = same;
  for (int round = 0; round < rounds; ++round) {
    const ModelStructure structure = structure_of(out.model);
    const ModeWorth worth(frf, structure, trial.user_weights);
    const double price = worth.price(out);
    AdditiveModel model = out.model;
    for (const ProposedMode& missed :
         proposed_modes(frf, out.model, trial.user_weights, together, trial.workers()))
      if (missed.gain > price) model.submodels.push_back(mode_submodel(frf, {}, missed.mode));
    if (model.submodels.size() == out.model.submodels.size()) break;
    FitResult fit = fit_additive_model(frf, model, trial);
    if (fit.status() == FitStatus::singular || !(worth.criterion(fit) < worth.criterion(out)))
      break;
    out = std::move(fit);
  }
  return out;
}

/// "422.217, 488.232 Hz": the modes that `more` has beside those of a model with `known` submodels.
std::string missing_frequencies(const FrfEstimate& frf, const FitOptions& trial,
                                const FitResult& more, std::size_t known) {
  const double price = ModeWorth(frf, structure_of(more.model), trial.user_weights).price(more);
  const std::vector<Submodel>& all = more.model.submodels;
  std::vector<std::size_t> found;
  for (std::size_t i = known; i < all.size(); ++i)
    if (const double f = all[i].natural_frequency_hz(); more.removal_cost[i] > price &&
                                                        f >= frf.frequency_hz[0] &&
                                                        f <= frf.frequency_hz[frf.lines() - 1])
      found.push_back(i);
  std::ranges::sort(found, std::ranges::greater(),
                    [&](std::size_t i) { return more.removal_cost[i]; });
  std::vector<double> places_hz;
  for (const std::size_t i : found) {
    const double f = all[i].natural_frequency_hz();
    const auto splits = [&](double other) {  // one resonance: within its half-power width
      return std::abs(f - other) < 2.0 * all[i].damping_ratio() * f;
    };
    if (places_hz.size() < kMostNamed && std::ranges::none_of(places_hz, splits))
      places_hz.push_back(f);
  }
  std::ranges::sort(places_hz);
  std::vector<std::string> places;
  for (const double f : places_hz) places.push_back(fmt::format("{:.4g}", f));
  return places.empty() ? "" : fmt::format("{} Hz", fmt::join(places, ", "));
}

void advise_structure(const FrfEstimate& frf, const FitOptions& options, const FitOptions& trial,
                      const FitResult& same, ModeNumber number, bool cut_short, FitReason& reason) {
  const ModeWorth worth(frf);
  double least = worth.criterion(same);
  const auto advise = [&](const FitResult& fit, const std::string& flags) {
    const double criterion = worth.criterion(fit);
    if (fit.status() == FitStatus::singular || !(criterion < least)) return false;
    least = criterion;
    reason.flags = flags;
    reason.remedy =
        fmt::format("Try {}: one refit lowers the squared residual from {:.6g} to {:.6g}", flags,
                    same.model.fit.cost, fit.model.fit.cost);
    return true;
  };
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
  for (const StructureMove& other : moves)
    advise(fit_additive_model(frf, other.model, other.options), other.flag);
  // A search for the number of modes has tried them.
  if (cut_short || number == ModeNumber::chosen) return;
  // One mode more competes with one other change of the structure: any number of modes imitates anything.
  if (!advise(with_missing_modes(frf, trial, same, 1, 1), "--modes auto")) return;
  const FitResult more = with_missing_modes(frf, trial, same, kRounds, kTried);
  const std::string places = missing_frequencies(frf, trial, more, same.model.submodels.size());
  reason.remedy = fmt::format(
      "Try {}: a refit with more modes lowers the squared residual from {:.6g} to {:.6g}",
      reason.flags, same.model.fit.cost, more.model.fit.cost);
  if (!places.empty()) reason.what += ": modes are missing at " + places;
}

/// If the complex conjugate of the response fits clearly better from the same start.
std::string of_reversed_time(const FrfEstimate& frf, const FitOptions& trial,
                             const AdditiveModel& model) {
  AdditiveModel start = model;
  std::erase_if(start.submodels, is_searched_mode);
  for (const ModeCandidate& mode : pick_modes(frf))
    start.submodels.push_back(mode_submodel(frf, structure_of(model), mode));
  const FitResult as_measured = fit_additive_model(frf, start, trial);
  FrfEstimate reversed = frf;
  reversed.response = frf.response.conjugate();
  start.input_delay_s *= -1.0;
  start.output_delay_s *= -1.0;
  const FitResult fit = fit_additive_model(reversed, start, trial);
  if (fit.status() == FitStatus::singular ||
      !(2.0 * fit.model.fit.cost < as_measured.model.fit.cost))
    return {};
  return fmt::format(
      "The complex conjugate of the response fits better (squared residual {:.6g} instead of "
      "{:.6g}): the recorder may use the other sign of time, or the plant is unstable",
      fit.model.fit.cost, as_measured.model.fit.cost);
}

}  // namespace

FitReason with_advice(FitReason reason, const FrfEstimate& whole, const FitOptions& options,
                      const FitResult& fit, ModeNumber number, bool cut_short) {
  reason.remedy = without_silent_channels(whole);
  if (!reason.remedy.empty()) return reason;
  // A dozen fits to all of many channels would take longer than the search.
  const PartOfData part = part_of_channels(whole, trial_options(whole, options), fit.model);
  const FrfEstimate& frf = part.frf;
  FitOptions trial = part.options;
  trial.limit.reset();
  // In a search that ended early, poles have not converged.
  FitOptions with_deviations = trial;
  with_deviations.uncertainty = true;
  with_deviations.response_variance = false;
  const FitResult same = fit_additive_model(frf, part.model, with_deviations);
  if (!cut_short) reason.remedy = of_reversed_time(frf, trial, same.model);
  if (!reason.remedy.empty()) return reason;
  advise_structure(frf, options, trial, same, number, cut_short, reason);
  if (reason.flags.empty())
    reason.remedy =
        "No other structure fits better: look there for disturbed lines or a disturbed channel";
  if (!part.all)
    reason.remedy +=
        fmt::format(" (tried on {} of {} channels)", frf.response.rows(), whole.response.rows());
  return reason;
}

FitReason limit_reason(const FrfEstimate& frf, const FitOptions& options, const FitResult& fit) {
  FitReason reason{options.limit->status(), options.limit->message()};
  if (options.limit->was_interrupted() || fit.status() == FitStatus::singular) return reason;
  const double budget_s = options.limit->budget_s();
  reason.what = fmt::format("the search reached its budget of {:.6g} s at {}", budget_s,
                            counted(count_modes(fit.model), "mode"));
  reason = with_advice(std::move(reason), frf, options, fit, ModeNumber::chosen, true);
  const std::string longer = fmt::format("--search-seconds {:.6g}", kMoreBudget * budget_s);
  reason.remedy += "; continue with " + longer;
  reason.flags += (reason.flags.empty() ? "" : " ") + longer;
  return reason;
}

}  // namespace stageid
