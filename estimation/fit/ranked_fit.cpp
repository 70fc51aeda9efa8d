#include "estimation/fit/ranked_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "estimation/fit/coincident_modes.hpp"
#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/fit/mode_worth.hpp"
#include "estimation/fit/overlapping_modes.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/fit/settled_fit.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/search_limit.hpp"

namespace stageid {
namespace {

/// Excess of a chi-square variable over its degrees of freedom, in standard deviations.
double sigmas_above(double chi_square, Eigen::Index degrees) {
  const auto n = static_cast<double>(degrees);
  return (chi_square - n) / std::sqrt(2.0 * std::max(n, 1.0));
}

class RankedFit {
 public:
  RankedFit(const FrfEstimate& frf, const FitOptions& options, FitEvidence& evidence)
      : frf_(frf),
        options_(options),
        evidence_(evidence),
        number_(evidence.number),
        data_(frf.independent_numbers()) {}

  FitResult run(const AdditiveModel& start) {
    tied_ = with_coincident_tied(start);
    fit_free();
    if (free_.status() == FitStatus::singular) return std::move(free_);
    best_ = constrained(tied_);
    if (best_.status() != FitStatus::singular && may_tie()) {
      if (number_ == ModeNumber::chosen) raise();
      settle();
      if (number_ == ModeNumber::asked) make_room();
      part();
      lower();
    }
    return finish();
  }

 private:
  void fit_free() {
    FitOptions options = options_;
    options.residue_rank = options.rigid_body_rank = 0;
    options.judge_modes = options.response_variance = false;
    options.uncertainty = true;
    free_ = settled_fit(frf_, tied_.model, options, number_);
    if (free_.model.submodels.size() != tied_.ranks.size())  // settled without some of them
      tied_.ranks.assign(free_.model.submodels.size(), 0);
    tied_.model = free_.model;
  }

  FitResult constrained(const TiedModel& tied) const {
    FitOptions options = options_;
    options.mode_ranks = tied.ranks;
    return fit_additive_model(frf_, tied.model, options);
  }

  /// Modes with B_0 and B_1 can only have rank one.
  bool may_tie() const {
    return options_.residue_rank == 1 && !(options_.limit && options_.limit->reached()) &&
           std::none_of(
               tied_.model.submodels.begin(), tied_.model.submodels.end(),
               [](const Submodel& s) { return is_searched_mode(s) && s.numerator.size() > 1; });
  }

  double criterion(const FitResult& fit) const { return ModeWorth(frf_).criterion(fit); }

  /// Adopts a fit that is better.
  bool adopt(const TiedModel& tied, FitResult&& trial) {
    if (trial.status() == FitStatus::singular || !(criterion(trial) < criterion(best_)))
      return false;
    if (!trial.trustworthy() && best_.trustworthy() &&
        kDearest * trial.model.fit.cost > best_.model.fit.cost)
      return false;
    tied_ = {trial.model, tied.ranks};
    best_ = std::move(trial);
    return true;
  }

  /// Raises the ranks of modes whose free residues have a higher rank.
  void raise() {
    TiedModel raised{free_.model, tied_.ranks};
    std::vector<std::string> said;
    for (const ResidueRankTest& test : free_.residue_ranks)
      if (test.rank > std::max(raised.ranks[test.submodel], 1)) {
        raised.ranks[test.submodel] = test.rank;
        said.push_back(
            fmt::format("{:.6g} Hz counts as {} of rank one: chi-square {:.4g} for the {} residue "
                        "parameters beyond one shape",
                        test.natural_frequency_hz, counted(test.rank, "mode"), test.chi_square,
                        test.parameters));
      }
    if (said.empty() || !adopt(raised, constrained(raised))) return;
    decisions_.insert(decisions_.end(), said.begin(), said.end());
  }

  /// Ties modes that converge to each other and prevent convergence.
  void settle() {
    while (!best_.trustworthy()) {
      const std::vector<std::pair<std::size_t, std::size_t>> pairs = overlapping_modes(best_.model);
      const auto tie = [&](const std::pair<std::size_t, std::size_t>& pair) {
        const auto [i, j] = pair;
        const double one_hz = best_.model.submodels[i].natural_frequency_hz();
        const double other_hz = best_.model.submodels[j].natural_frequency_hz();
        const double cost = best_.model.fit.cost;
        const TiedModel tied = with_tied({best_.model, tied_.ranks}, i, j);
        FitResult trial = constrained(tied);
        if (!adopt(tied, FitResult(trial))) {
          // They are separate, but the start was too far away.
          const auto apart = with_parted(frf_, {trial.model, tied.ranks}, i, options_);
          return apart && adopt(*apart, constrained(*apart));
        }
        decisions_.push_back(
            fmt::format("modes of {:.7g} and {:.7g} Hz are indistinguishable and now share one "
                        "frequency: cost {:.6g} -> {:.6g}",
                        one_hz, other_hz, cost, best_.model.fit.cost));
        return true;
      };
      if (!std::any_of(pairs.begin(),
                       pairs.begin() + static_cast<std::ptrdiff_t>(std::min(pairs.size(), kTried)),
                       tie))
        return;
    }
  }

  /// With a requested number of modes: removes the least worthy modes in favour of missing shapes.
  void make_room() {
    TiedModel raised{free_.model, std::vector<int>(free_.model.submodels.size(), 0)};
    std::size_t wanted = 0;
    for (const ResidueRankTest& test : free_.residue_ranks) {
      if (test.rank < 2) continue;
      raised.ranks[test.submodel] = test.rank;
      wanted += static_cast<std::size_t>(test.rank) - 1;
    }
    if (wanted == 0) return;
    FitResult candidates = free_;
    for (std::size_t i = 0; i < raised.ranks.size(); ++i)
      if (raised.ranks[i] > 1) candidates.removal_cost[i] = HUGE_VAL;
    const std::vector<std::size_t> out = least_worthy(candidates, HUGE_VAL, wanted);
    if (out.size() < wanted) return;
    std::string said = "instead of";
    for (const std::size_t i : out)
      said += fmt::format(" {:.6g} Hz", free_.model.submodels[i].natural_frequency_hz());
    for (std::size_t n = out.size(); n-- > 0;) {
      const auto i = static_cast<std::ptrdiff_t>(out[n]);
      raised.model.submodels.erase(raised.model.submodels.begin() + i);
      raised.ranks.erase(raised.ranks.begin() + i);
    }
    const double cost = best_.model.fit.cost;
    if (!adopt(raised, constrained(raised))) return;
    for (const ResidueRankTest& test : free_.residue_ranks)
      if (test.rank > 1)
        said +=
            fmt::format(", {} at {:.6g} Hz", counted(test.rank, "mode"), test.natural_frequency_hz);
    decisions_.push_back(
        fmt::format("{}: cost {:.6g} -> {:.6g}", said, cost, best_.model.fit.cost));
  }

  /// Separates modes at the same frequency if the data require it.
  void part() {
    for (std::size_t i = 0; i < tied_.ranks.size(); ++i) {
      if (tied_.ranks[i] != 2) continue;
      const std::optional<TiedModel> apart = with_parted(frf_, tied_, i, options_);
      const double cost = best_.model.fit.cost;
      if (!apart || !adopt(*apart, constrained(*apart))) continue;
      decisions_.push_back(fmt::format(
          "modes of {:.7g} and {:.7g} Hz are distinguishable: cost {:.6g} -> {:.6g}",
          best_.model.submodels[i].natural_frequency_hz(),
          best_.model.submodels[i + 1].natural_frequency_hz(), cost, best_.model.fit.cost));
    }
  }

  /// Lowers a raised rank that is not worth its parameters, given the ranks of the others.
  void lower() {
    for (std::size_t i = 0; i < tied_.ranks.size();) {
      TiedModel lowered{best_.model, tied_.ranks};
      const double cost = best_.model.fit.cost;
      if (number_ != ModeNumber::chosen || lowered.ranks[i]-- < 2 ||
          !adopt(lowered, constrained(lowered))) {
        ++i;
        continue;
      }
      decisions_.push_back(fmt::format("one mode fewer at {:.6g} Hz: cost {:.6g} -> {:.6g}",
                                       best_.model.submodels[i].natural_frequency_hz(), cost,
                                       best_.model.fit.cost));
    }
  }

  /// Finds modes whose residues have a higher rank than allowed.
  void find_too_low_ranks() {
    if (options_.residue_rank == 0) return;
    const double rise = data_ * std::log(best_.model.fit.cost / free_.model.fit.cost);
    const auto given_up = static_cast<double>(free_.parameters - best_.parameters);
    if (!(rise > std::max(given_up, 1.0) * std::log(data_))) return;
    std::string places;
    for (const ResidueRankTest& test : free_.residue_ranks)
      if (test.rank > options_.residue_rank && !is_raised(test))
        places += fmt::format("{}{:.6g} Hz (rank {})", places.empty() ? "" : ", ",
                              test.natural_frequency_hz, test.rank);
    if (places.empty()) return;
    const bool of_any_rank = may_tie() || options_.residue_rank > 1;
    evidence_.low_ranks = fmt::format(
        "rank {} is too low for the residues at {}: the cost is {:.3g} times that of "
        "free residues; use --residue-rank {}{}",
        options_.residue_rank, places, best_.model.fit.cost / free_.model.fit.cost,
        of_any_rank ? fmt::format("{}", options_.residue_rank + 1) : "full",
        number_ == ModeNumber::chosen ? "" : ", or add one mode there per shape");
  }

  bool is_raised(const ResidueRankTest& test) const {
    for (std::size_t i = 0; i < tied_.ranks.size(); ++i) {
      const Submodel& s = tied_.model.submodels[i];
      if (!is_searched_mode(s) || tied_.ranks[i] < test.rank) continue;
      const double width = 2.0 * s.damping_ratio() * s.natural_frequency_hz();
      if (std::abs(s.natural_frequency_hz() - test.natural_frequency_hz) < width) return true;
    }
    return false;
  }

  FitResult finish() {
    split_tied(tied_.ranks, best_);
    const std::string decision = rank_decision(
        free_.model.fit.cost, best_.model.fit.cost, 2.0 * static_cast<double>(frf_.lines()),
        free_.parameters - best_.parameters, weighs_by_variance(options_.weighting));
    find_too_low_ranks();
    std::vector<std::string> all = std::move(free_.decisions);
    all.push_back(decision);
    all.insert(all.end(), decisions_.begin(), decisions_.end());
    all.insert(all.end(), best_.decisions.begin(), best_.decisions.end());
    best_.decisions = std::move(all);
    best_.cost.insert(best_.cost.begin(), free_.cost.begin(), free_.cost.end());
    best_.residue_ranks = std::move(free_.residue_ranks);
    return std::move(best_);
  }

  const FrfEstimate& frf_;
  const FitOptions& options_;
  FitEvidence& evidence_;
  ModeNumber number_;
  double data_;
  FitResult free_;
  TiedModel tied_;  // of best_
  FitResult best_;
  std::vector<std::string> decisions_;
};

}  // namespace

FitResult ranked_fit(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options,
                     FitEvidence& evidence) {
  return options.residue_rank > 0 ? RankedFit(frf, options, evidence).run(start)
                                  : settled_fit(frf, start, options, evidence.number);
}

std::string rank_decision(double free_cost, double cost, double cost_to_squares,
                          Eigen::Index given_up, bool likelihood) {
  std::string text =
      fmt::format("residues of the given ranks: cost {:.6g} -> {:.6g}", free_cost, cost);
  if (cost <= free_cost) return text + ", by more modes";
  if (!likelihood) return text;
  // Twice the rise of sum W |E|^2 is chi-square distributed if the ranks are right.
  const double rise = 2.0 * cost_to_squares * (cost - free_cost);
  return text +
         fmt::format(
             ", chi-square {:.4g} for {} parameters removed: {}", rise, given_up,
             sigmas_above(rise, given_up) < kClearly
                 ? "consistent with noise"
                 : "more than noise explains; the ranks are too low or the variances too small");
}

}  // namespace stageid
