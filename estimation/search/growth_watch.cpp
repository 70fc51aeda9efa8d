#include "estimation/search/growth_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "estimation/model/model_structure.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "estimation/search/fit_additive_model.hpp"
#include "estimation/search/mode_worth.hpp"
#include "estimation/search/search_constants.hpp"

namespace stageid {
namespace {

/// Whether mode `i` overlaps another. Broad modes do not count: they are not resonances that contain a narrow one.
bool overlaps_another(const AdditiveModel& model, std::size_t i) {
  const Submodel& one = model.submodels[i];
  const double f = one.natural_frequency_hz();
  for (std::size_t o = 0; o < model.submodels.size(); ++o) {
    const Submodel& other = model.submodels[o];
    if (o == i || !is_searched_mode(other) || other.damping_ratio() > kBroad) continue;
    const double width = 2.0 * f * std::max(one.damping_ratio(), other.damping_ratio());
    if (std::abs(other.natural_frequency_hz() - f) < width) return true;
  }
  return false;
}

bool is_coloured(const FitResult& fit, std::size_t i) {
  const AdditiveModel& model = fit.model;
  const Submodel& s = model.submodels[i];
  const double f = s.natural_frequency_hz();
  return fit.is_held(i) || f < model.fit.band_hz[0] || f > model.fit.band_hz[1] ||
         s.damping_ratio() > kBroad || overlaps_another(model, i);
}

/// Whether the modes added by a round are not worth their parameters without their best line each. With noise tails
/// heavier than assumed, every outlier would be fitted by a mode.
bool rests_on_single_lines(const FrfEstimate& frf, const FitOptions& options,
                           const FitResult& before, const FitResult& now, std::size_t added) {
  const SharedMatrix<Eigen::MatrixXd> weights = make_weights(frf, options);
  const Team& team = *options.workers().team;
  Eigen::VectorXd gain = squares_of_lines(frf, before.model, weights, team) -
                         squares_of_lines(frf, now.model, weights, team);
  const auto n = static_cast<Eigen::Index>(added);
  std::sort(gain.begin(), gain.end());
  const auto parameters = static_cast<double>(now.parameters - before.parameters);
  return gain.head(std::max<Eigen::Index>(0, gain.size() - n)).sum() <
         static_cast<double>(added) *
             price_of_mode(frf, before, parameters / static_cast<double>(added));
}

}  // namespace

bool GrowthWatch::ends(const FrfEstimate& frf, const FitOptions& options, const FitResult& before,
                       const FitResult& now, std::size_t added) {
  if (rounds_ == 0) first_ = before;
  ++rounds_;
  bool spurious = true;
  for (std::size_t i = now.model.submodels.size() - added; i < now.model.submodels.size(); ++i)
    spurious = spurious && is_coloured(now, i);
  spurious = spurious || rests_on_single_lines(frf, options, before, now, added);
  if (!spurious) spurious_in_a_row_ = 0;
  if (spurious && spurious_in_a_row_++ == 0) back_to_ = before;
  // In every second, fourth, eighth round: a small part of the cost of the search.
  if (rounds_ > 1 && std::has_single_bit(static_cast<unsigned>(rounds_)) &&
      a_delay_explains_more(frf, options, now))
    return true;
  if (spurious_in_a_row_ < kMostSpurious) return false;
  finding_ = fmt::format(
      "the search for modes ended: its last {} steps added no resonance, cost {:.6g} -> {:.6g}; "
      "these modes were discarded. The variances may be too small, or modes alone cannot describe "
      "the plant: try --damping general, --direct-term full or --delay estimate",
      spurious_in_a_row_, back_to_.model.fit.cost, now.model.fit.cost);
  return true;
}

bool GrowthWatch::a_delay_explains_more(const FrfEstimate& frf, const FitOptions& searched,
                                        const FitResult& now) {
  if (searched.delay != DelayModel::fixed) return false;
  FitOptions options = searched;
  options.delay = DelayModel::estimate;
  options.delay_s = 0.0;  // 0 starts the search for a delay; a wrong value would not
  AdditiveModel start = first_.model;
  start.input_delay_s.resize(0);
  start.output_delay_s.resize(0);
  const FitResult trial = fit_additive_model(frf, start, options);
  if (trial.status() == FitStatus::singular) return false;
  if (!(information_criterion(frf, trial) < information_criterion(frf, now))) return false;
  by_delay_ = true;
  back_to_ = std::move(first_);
  finding_ = fmt::format(
      "a delay of {:.4g} s instead of {:.4g} s fits better (squared residual {:.6g}) than {} more "
      "modes ({:.6g}), which were discarded; use --delay estimate",
      trial.model.mean_delay_s(), searched.delay_s, trial.model.fit.cost,
      count_modes(now.model) - count_modes(back_to_.model), now.model.fit.cost);
  return true;
}

}  // namespace stageid
