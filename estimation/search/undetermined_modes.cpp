#include "estimation/search/undetermined_modes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "estimation/model/model_structure.hpp"
#include "estimation/search/fit_additive_model.hpp"
#include "estimation/search/mode_worth.hpp"
#include "estimation/search/overlapping_modes.hpp"

namespace stageid {
namespace {

constexpr std::size_t kUndeterminedTried = 4;  // one fit each

bool is_open(const Submodel& s) {
  return s.natural_frequency_std_hz.value_or(0.0) >= kOpenFrequency * s.natural_frequency_hz() ||
         s.damping_ratio_std.value_or(0.0) >= kOpenDamping * s.damping_ratio();
}

/// @param with_flanks also peaks outside the lines whose flank is on the lines
bool is_between_lines(const Submodel& s, const FitRecord& record, bool with_flanks) {
  const double f = s.natural_frequency_hz();
  const double reach = with_flanks && s.damping_ratio() < kBroad ? s.damping_ratio() * f : 0.0;
  return f >= record.band_hz[0] - reach && f <= record.band_hz[1] + reach;
}

/// Two for the pole, plus those of a residue of its rank.
double parameters_of(const Submodel& s) {
  const auto n_y = static_cast<double>(s.numerator[0].rows());
  const auto n_u = static_cast<double>(s.numerator[0].cols());
  const double rank = s.residue_rank.value_or(0);
  const double residue = rank > 0.0 ? rank * (n_y + n_u - rank) : n_y * n_u;
  return 2.0 + static_cast<double>(s.numerator.size()) * residue;
}

/// Why mode `i` is not a resonance of the data; empty if it may be one.
std::string doubt_of(const FrfEstimate& frf, bool number_asked, const FitResult& fit,
                     std::size_t i) {
  const Submodel& s = fit.model.submodels[i];
  if (!is_searched_mode(s) || s.frequency_held || s.damping_held) return {};
  if (is_between_lines(s, fit.model.fit, number_asked)) {
    if (fit.is_held(i))
      return s.damping_ratio() < kBroad
                 ? "at its bound: narrower than the line spacing, undamped or unstable"
                 : "at its bound";
    if (is_open(s)) return "with a standard deviation as large";
  }
  if (number_asked && i < fit.removal_cost.size() &&
      fit.removal_cost[i] < price_of_mode(frf, fit, parameters_of(s)))
    return "does not justify its parameters (BIC)";
  return {};
}

void tell(std::string text, FitResult& fit) {
  fit.decisions.push_back(text);
  fit.findings.push_back(std::move(text));
  if (fit.trustworthy()) fit.distrust(FitStatus::undetermined, fit.findings.back());
}

}  // namespace

std::vector<std::size_t> undetermined_modes(const FitResult& fit) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
    if (!doubt_of({}, false, fit, i).empty()) out.push_back(i);
  }
  return out;
}

void judge_undetermined_modes(const FrfEstimate& frf, bool number_asked, FitResult& fit) {
  std::vector<std::string> places;
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
    const std::string doubt = doubt_of(frf, number_asked, fit, i);
    if (doubt.empty()) continue;
    const Submodel& s = fit.model.submodels[i];
    places.push_back(fmt::format("{:.6g} Hz (damping ratio {:.3g}, {})", s.natural_frequency_hz(),
                                 s.damping_ratio(), doubt));
  }
  if (places.empty()) return;
  tell(fmt::format("the data do not support the modes at {}: a mode placed anywhere would lower "
                   "the cost as much; do not interpret them as resonances",
                   fmt::join(places, ", ")),
       fit);
}

void judge_close_modes(const FrfEstimate& frf, const FitOptions& options, FitResult& fit) {
  FitOptions plain = options;
  plain.uncertainty = plain.judge_modes = plain.covariance = false;
  const std::vector<std::pair<std::size_t, std::size_t>> pairs = overlapping_modes(fit.model);
  for (std::size_t p = 0; p < std::min(pairs.size(), kUndeterminedTried); ++p) {
    const auto [i, j] = pairs[p];
    const Submodel& one = fit.model.submodels[i];
    const Submodel& other = fit.model.submodels[j];
    const FitResult single = fit_additive_model(frf, with_one_of(fit.model, i, j), plain);
    const double rise =
        2.0 * static_cast<double>(frf.lines()) * (single.model.fit.cost - fit.model.fit.cost);
    if (single.status == FitStatus::singular ||
        !(rise < price_of_mode(frf, fit, parameters_of(one))))
      continue;
    tell(fmt::format("the data do not distinguish the modes at {:.6g} and {:.6g} Hz: one mode fits "
                     "as well (BIC), cost {:.6g} -> {:.6g}; request fewer modes",
                     one.natural_frequency_hz(), other.natural_frequency_hz(), fit.model.fit.cost,
                     single.model.fit.cost),
         fit);
  }
}

}  // namespace stageid
