#include "estimation/modes_above_noise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ranges>

#include "estimation/fit_additive_model.hpp"
#include "estimation/fit_start.hpp"
#include "estimation/numerators.hpp"
#include "estimation/rank_one_search.hpp"

namespace stageid {
namespace {

constexpr int kRounds = 8;
constexpr int kIterationsOfRound = 5;
constexpr double kExpectedPlaces = 1.0;  // of noise alone, in all of a search
constexpr double kDropped = 0.05;        // a found mode that noise exceeds as often as this

/// P(chi-square with n degrees of freedom > x), by the cube root of Wilson and Hilferty (PNAS 17 (1931)
/// 684).
double chi_square_tail(double x, double n) {
  const double variance = 2.0 / (9.0 * n);
  return 0.5 * std::erfc((std::cbrt(x / n) - 1.0 + variance) / std::sqrt(2.0 * variance));
}

class Separation {
 public:
  Separation(const FrfEstimate& frf, const ModelStructure& structure, const FitOptions& quick)
      : frf_(frf), structure_(structure), quick_(quick) {
    quick_.max_iterations = std::min(kIterationsOfRound, quick.max_iterations);
  }

  FitResult fit(const AdditiveModel& model) const {
    return fit_additive_model(frf_, model, quick_);
  }

  /// The model of `fit` without the modes whose removal costs no more than noise does with that
  /// probability. @param hidden they, the strongest first
  AdditiveModel visible(const FitResult& fit, double probability,
                        std::vector<Submodel>& hidden) const {
    std::vector<std::size_t> out;
    AdditiveModel model = fit.model;
    for (std::size_t i = 0; i < model.submodels.size(); ++i) {
      const Submodel& s = model.submodels[i];
      if (!is_searched_mode(s)) continue;
      const double numerators = static_cast<double>(s.numerator.size()) * channels();
      const double removal = fit.removal_cost[i] / noise(fit.model.fit.cost);
      if (chi_square_tail(removal, numerators) > probability) out.push_back(i);
    }
    std::stable_sort(out.begin(), out.end(), [&](std::size_t a, std::size_t b) {
      return fit.removal_cost[a] > fit.removal_cost[b];
    });
    hidden.clear();
    for (const std::size_t i : out) hidden.push_back(model.submodels[i]);
    std::sort(out.begin(), out.end());
    for (const std::size_t i : std::views::reverse(out))
      model.submodels.erase(model.submodels.begin() + static_cast<std::ptrdiff_t>(i));
    return model;
  }

  /// Adds the modes that the residual shows, at most that many. @returns how many
  int add_shown(int most, AdditiveModel& model) const {
    const FitProblem problem = make_problem(frf_, model, quick_, quick_.user_weights);
    FitParameters beta = make_parameters(problem, model, quick_);
    const std::vector<BasisGroup> groups = evaluate_groups(problem, beta, false);
    double cost = 0.0;
    if (!solve_numerators(problem, groups, beta.B, cost)) return 0;
    std::vector<RankOneMode> all =
        rank_one_modes(problem, groups, residual(problem, groups, beta.B), typical_damping(model));
    std::stable_sort(all.begin(), all.end(),
                     [](const RankOneMode& a, const RankOneMode& b) { return a.gain > b.gain; });
    const double numbers = static_cast<double>(frf_.n_outputs() + frf_.n_inputs()) - 1.0;
    std::vector<RankOneMode> added;
    for (const RankOneMode& candidate : all) {
      const double by_noise =
          static_cast<double>(all.size()) * chi_square_tail(candidate.gain / noise(cost), numbers);
      if (static_cast<int>(added.size()) == most || by_noise > kExpectedPlaces) break;
      // What a missing mode leaves beside its place falls with the distance squared.
      const bool beside = std::any_of(added.begin(), added.end(), [&](const RankOneMode& other) {
        const double distance = std::abs(other.mode.frequency_hz - candidate.mode.frequency_hz) /
                                (2.0 * other.mode.damping_ratio * other.mode.frequency_hz);
        return candidate.gain * distance * distance < other.gain;
      });
      if (!beside) added.push_back(candidate);
    }
    for (const RankOneMode& one : added)
      model.submodels.push_back(mode_submodel(frf_, structure_, one.mode));
    return static_cast<int>(added.size());
  }

 private:
  double channels() const { return static_cast<double>(frf_.response.rows()); }

  /// What one real number of the noise adds to sum W |E|^2.
  double noise(double cost) const { return cost / channels(); }

  static double typical_damping(const AdditiveModel& model) {
    std::vector<double> all;
    for (const Submodel& s : model.submodels)
      if (is_searched_mode(s)) all.push_back(s.damping_ratio());
    if (all.empty()) return 0.01;
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    return *middle;
  }

  const FrfEstimate& frf_;
  const ModelStructure& structure_;
  FitOptions quick_;
};

}  // namespace

AdditiveModel modes_above_noise(const FrfEstimate& frf, const ModelStructure& structure,
                                const FitResult& placed, const FitOptions& quick, int wanted,
                                std::vector<std::string>& decisions) {
  const Separation separation(frf, structure, quick);
  std::vector<Submodel> hidden;
  AdditiveModel model = separation.visible(placed, 1.0 / static_cast<double>(frf.lines()), hidden);
  if (hidden.empty()) return model;
  const int shown = count_modes(model);
  std::vector<Submodel> dropped;
  for (int round = 0; round < kRounds; ++round) {
    model = separation.visible(separation.fit(model), kDropped, dropped);
    if (separation.add_shown(wanted - count_modes(model), model) == 0) break;
  }
  const int found = count_modes(model);
  for (Submodel& s : hidden) {
    if (count_modes(model) == wanted) break;
    s.frequency_held = s.damping_held = true;
    model.submodels.push_back(s);
  }
  decisions.push_back(
      fmt::format("{} of them stand out of the noise, {} after a search of the residual for "
                  "residues of rank one; the poles of the other {} stay where they were placed",
                  shown, found, count_modes(model) - found));
  return model;
}

}  // namespace stageid
