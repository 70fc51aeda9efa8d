#include "estimation/automatic_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <thread>

#include "estimation/fit_problem.hpp"
#include "estimation/residual_modes.hpp"

namespace stageid {
namespace {

constexpr int kGrowthIterations = 12;   // a mode that is still moving is finished later
constexpr std::size_t kCandidates = 4;  // tried before it is believed that no mode is missing

Submodel mode_submodel(const FrfEstimate& frf, const ModelStructure& structure,
                       const ModeCandidate& mode) {
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  Submodel s;
  s.denominator = {1.0, 2.0 * mode.damping_ratio / omega, 1.0 / (omega * omega)};
  s.numerator.assign(structure.general_damping ? 2 : 1,
                     Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs()));
  return s;
}

std::vector<Submodel> fixed_submodels(const FrfEstimate& frf, const ModelStructure& structure) {
  std::vector<Submodel> out;
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs());
  if (structure.rigid_body) out.push_back({2, {1.0}, {zero}, {}, {}});
  if (structure.direct_term) out.push_back({0, {1.0}, {zero}, {}, {}});
  return out;
}

int count_modes(const AdditiveModel& model) {
  return static_cast<int>(std::count_if(model.submodels.begin(), model.submodels.end(),
                                        [](const Submodel& s) { return s.is_mode(); }));
}

void sort_modes(AdditiveModel& model) {
  std::stable_sort(model.submodels.begin(), model.submodels.end(),
                   [](const Submodel& a, const Submodel& b) {
                     if (a.is_mode() != b.is_mode()) return b.is_mode();
                     return a.is_mode() && a.natural_frequency_hz() < b.natural_frequency_hz();
                   });
}

/// Grows and prunes a model; every decision is written down.
class AutomaticFit {
 public:
  AutomaticFit(const FrfEstimate& frf, const ModelStructure& structure,
               const ModeSelection& selection, const FitOptions& options)
      : frf_(frf),
        structure_(structure),
        selection_(selection),
        options_(options),
        quick_(options) {
    quick_.user_weights = make_weights(frf, options);
    quick_.weighting = Weighting::user;
    quick_.uncertainty = false;
    quick_.max_iterations = std::min(kGrowthIterations, options.max_iterations);
    quick_.gradient_tolerance = 1e-5;
    quick_.step_tolerance = 1e-7;
    quick_.method = FitMethod::gn;  // the same minimum; the refined-IV iteration does the final fit
    quick_.progress = nullptr;
    threads_ = options.threads > 0
                   ? options.threads
                   : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    signal_ = (quick_.user_weights.array() * frf.response.cwiseAbs2().array()).sum();
  }

  FitResult run() {
    best_ = fit_additive_model(frf_, start(), quick_);
    if (best_.status == FitStatus::singular) return finish();
    if (selection_.keep_modes) return finish();
    grow();
    prune();
    if (grow() && selection_.exactly == 0) prune();
    return finish();
  }

 private:
  AdditiveModel start() {
    std::vector<ModeCandidate> modes = selection_.modes;
    if (modes.empty() && !selection_.keep_modes) {
      modes = pick_modes(frf_);
      const std::size_t most = static_cast<std::size_t>(affordable_modes());
      if (modes.size() > most) modes.resize(most);
      say("start: {} peaks of the CMIF", modes.size());
    } else {
      say("start: {} modes given", modes.size());
    }
    AdditiveModel model;
    model.submodels = fixed_submodels(frf_, structure_);
    for (const ModeCandidate& mode : modes)
      model.submodels.push_back(mode_submodel(frf_, structure_, mode));
    if (model.submodels.empty())
      model.submodels.push_back(mode_submodel(frf_, structure_, strongest_peak()));
    return model;
  }

  ModeCandidate strongest_peak() const {
    Eigen::Index k = 0;
    cmif(frf_, CmifKind::accelerance).row(0).maxCoeff(&k);
    return {frf_.frequency_hz[k], 0.01, 1};
  }

  /// More functions than this the lines cannot carry.
  int affordable_modes() const {
    const Eigen::Index per_mode = structure_.general_damping ? 2 : 1;
    const Eigen::Index fixed = (structure_.rigid_body ? 1 : 0) + (structure_.direct_term ? 1 : 0);
    const Eigen::Index limit = (2 * frf_.lines() / 3 - fixed) / (per_mode + 1);
    return static_cast<int>(
        std::max<Eigen::Index>(1, std::min<Eigen::Index>(limit, selection_.most)));
  }

  double squares(const FitResult& fit) const {
    return 2.0 * static_cast<double>(frf_.lines()) * fit.model.fit.cost;
  }

  /// BIC with the scale of the variances unknown: 2 N n_c ln V + n ln(2 N n_c). Where the variances
  /// are right it decides like the one with known variance; where the model cannot be right, it
  /// does not chase errors.
  double bic(const FitResult& fit) const {
    const double data = static_cast<double>(frf_.response.size());
    double parameters = 0.0;
    for (const Submodel& s : fit.model.submodels)
      parameters +=
          static_cast<double>(s.denominator.size() - 1) +
          static_cast<double>(s.numerator.size()) * static_cast<double>(frf_.response.rows());
    return 2.0 * data * std::log(std::max(squares(fit), 1e-26 * signal_)) +
           parameters * std::log(2.0 * data);
  }

  bool wanted_more() const {
    const int modes = count_modes(best_.model);
    if (selection_.exactly > 0) return modes < selection_.exactly;
    return modes < affordable_modes() && squares(best_) > 1e-24 * signal_;
  }

  /// Adds modes while they are worth it. @returns true if any was added.
  bool grow() {
    bool grown = false;
    while (wanted_more() && add_one()) grown = true;
    return grown;
  }

  bool add_one() {
    const std::vector<ResidualMode> candidates =
        residual_modes(frf_, best_.model, quick_.user_weights, kCandidates, threads_);
    FitResult best_trial;
    bool found = false;
    for (const ResidualMode& candidate : candidates) {
      AdditiveModel model = best_.model;
      model.submodels.push_back(mode_submodel(frf_, structure_, candidate.mode));
      FitResult trial = fit_additive_model(frf_, model, quick_);
      if (trial.status == FitStatus::singular) continue;
      const bool better = !found || trial.model.fit.cost < best_trial.model.fit.cost;
      if (better) best_trial = std::move(trial);
      found = true;
      // The first candidate is usually right; the others are asked only where it is not worth its
      // parameters.
      if (bic(best_trial) < bic(best_)) break;
    }
    if (!found) return false;
    const Submodel& added = best_trial.model.submodels.back();
    if (selection_.exactly == 0 && !(bic(best_trial) < bic(best_))) {
      say("no further mode: the best, {:.6g} Hz, would lower the cost by {:.2g} % and is not worth "
          "its parameters (BIC)",
          added.natural_frequency_hz(),
          100.0 * (1.0 - best_trial.model.fit.cost / best_.model.fit.cost));
      return false;
    }
    say("added {:.6g} Hz (damping {:.3g}): cost {:.6g} -> {:.6g}", added.natural_frequency_hz(),
        added.damping_ratio(), best_.model.fit.cost, best_trial.model.fit.cost);
    adopt(std::move(best_trial));
    return true;
  }

  /// Drops modes that are not worth their parameters, the least worthy first.
  void prune() {
    while (count_modes(best_.model) > 1) {
      const bool too_many = selection_.exactly > 0 && count_modes(best_.model) > selection_.exactly;
      if (selection_.exactly > 0 && !too_many) return;
      FitOptions numerators_only = quick_;
      numerators_only.max_iterations = 0;
      FitResult least;
      double frequency = 0.0;
      bool found = false;
      for (std::size_t i = 0; i < best_.model.submodels.size(); ++i) {
        if (!best_.model.submodels[i].is_mode()) continue;
        AdditiveModel model = best_.model;
        model.submodels.erase(model.submodels.begin() + static_cast<std::ptrdiff_t>(i));
        FitResult trial = fit_additive_model(frf_, model, numerators_only);
        if (trial.status == FitStatus::singular ||
            (found && trial.model.fit.cost >= least.model.fit.cost))
          continue;
        frequency = best_.model.submodels[i].natural_frequency_hz();
        least = std::move(trial);
        found = true;
      }
      if (!found) return;
      // Only a mode that is nearly free deserves a fit without it.
      if (!too_many && squares(least) > 1.2 * squares(best_)) return;
      FitResult without = fit_additive_model(frf_, least.model, quick_);
      if (!too_many && !(bic(without) < bic(best_))) return;
      say("dropped {:.6g} Hz: cost {:.6g} -> {:.6g}", frequency, best_.model.fit.cost,
          without.model.fit.cost);
      adopt(std::move(without));
    }
  }

  FitResult finish() {
    sort_modes(best_.model);
    FitResult result = fit_additive_model(frf_, best_.model, options_);
    decisions_.insert(decisions_.end(), result.decisions.begin(), result.decisions.end());
    result.decisions = std::move(decisions_);
    return result;
  }

  void adopt(FitResult&& result) { best_ = std::move(result); }

  template <typename... Args>
  void say(fmt::format_string<Args...> format, Args&&... args) {
    decisions_.push_back(fmt::format(format, std::forward<Args>(args)...));
  }

  const FrfEstimate& frf_;
  const ModelStructure& structure_;
  const ModeSelection& selection_;
  const FitOptions& options_;
  FitOptions quick_;
  int threads_ = 1;
  double signal_ = 0.0;
  FitResult best_;
  std::vector<std::string> decisions_;
};

}  // namespace

FitResult automatic_fit(const FrfEstimate& frf, const ModelStructure& structure,
                        const ModeSelection& selection, const FitOptions& options) {
  check(frf);
  if (selection.exactly < 0 || selection.most < 1)
    throw std::invalid_argument("fit: the number of modes must be positive");
  return AutomaticFit(frf, structure, selection, options).run();
}

}  // namespace stageid
