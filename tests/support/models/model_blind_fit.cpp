#include "tests/support/models/model_blind_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/numerators.hpp"
#include "estimation/problem/fit_start.hpp"
#include "estimation/problem/residual.hpp"
#include "estimation/search/automatic_fit.hpp"

namespace stageid::test {
namespace {

constexpr double kAllowedExcess = 0.005;

std::vector<const Submodel*> modes_of(const AdditiveModel& model) {
  std::vector<const Submodel*> modes;
  for (const Submodel& s : model.submodels)
    if (s.is_mode()) modes.push_back(&s);
  return modes;
}

/// Modes of `wanted` without a mode of `given`: the closest pairs within a half-power width are removed first.
std::vector<double> unmatched(const AdditiveModel& wanted, const AdditiveModel& given) {
  const std::vector<const Submodel*> from = modes_of(wanted);
  const std::vector<const Submodel*> to = modes_of(given);
  struct Pair {
    std::size_t i;
    std::size_t j;
    double distance;  ///< in half-power widths
  };
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < from.size(); ++i)
    for (std::size_t j = 0; j < to.size(); ++j) {
      const double f = from[i]->natural_frequency_hz();
      const double width = 2.0 * f * std::max(from[i]->damping_ratio(), to[j]->damping_ratio());
      pairs.push_back({i, j, std::abs(f - to[j]->natural_frequency_hz()) / width});
    }
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
  std::vector<bool> used_from(from.size(), false);
  std::vector<bool> used_to(to.size(), false);
  for (const Pair& pair : pairs) {
    if (pair.distance > 1.0 || used_from[pair.i] || used_to[pair.j]) continue;
    used_from[pair.i] = used_to[pair.j] = true;
  }
  std::vector<double> out;
  for (std::size_t i = 0; i < from.size(); ++i)
    if (!used_from[i]) out.push_back(from[i]->natural_frequency_hz());
  return out;
}

/// Peaks of the CMIF but for those that are to be missing, drawn from the stage's seed.
std::vector<ModeCandidate> peaks_left(const RandomStage& stage) {
  std::vector<ModeCandidate> peaks = pick_modes(stage.frf);
  RandomNumbers random(stage.seed + 77);
  for (int i = 0; i < stage.missing_peaks && peaks.size() > 1; ++i)
    peaks.erase(peaks.begin() + random.integer(0, static_cast<int>(peaks.size()) - 1));
  return peaks;
}

}  // namespace

bool plain_iteration_succeeds(const RandomStage& stage, double wanted, int threads) {
  constexpr int kIterations = 30;
  const std::vector<ModeCandidate> peaks = peaks_left(stage);
  if (peaks.size() > modes_of(stage.truth).size() + 1) return false;
  FitOptions options;
  options.weighting = Weighting::noise_variance;
  options.hold = HoldModel::exact;
  options.delay_s = stage.delay_s;
  options.threads = threads;
  AdditiveModel start;
  start.submodels = fixed_submodels(stage.frf, ModelStructure{});
  for (const ModeCandidate& peak : peaks)
    start.submodels.push_back(mode_submodel(stage.frf, ModelStructure{}, peak));
  const FitProblem problem =
      make_problem(stage.frf, start, options, make_weights(stage.frf, options));
  FitParameters beta = make_parameters(problem, start, options);
  const auto solved = solve_numerators(problem, evaluate_groups(problem, beta, false), beta.B);
  if (!solved) return false;
  double cost = solved->cost;
  for (int i = 0; i < kIterations; ++i) {
    const std::vector<BasisGroup> groups = evaluate_groups(problem, beta, true);
    const ArrowSystem system(problem, beta, groups, FitMethod::riv);
    if (!system.regular()) return false;
    const Eigen::VectorXd step = system.solve_globals(0.0);
    if (!step.allFinite()) return false;
    beta = stepped(problem, beta, step);
    for (Eigen::Index c = 0; c < problem.channels(); ++c)
      beta.B.row(c) += (system.channel(c).x - system.channel(c).Z * step).transpose();
    const double next = residual_cost(problem, evaluate_groups(problem, beta, false), beta.B);
    if (!std::isfinite(next) || next > 1e12 * wanted) return false;
    if (std::abs(next - cost) < 1e-9 * cost) break;
    cost = next;
  }
  return cost < (1.0 + kAllowedExcess) * wanted;
}

BlindFit fit_blind(const RandomStage& stage, int threads) {
  FitOptions options;
  options.weighting = Weighting::noise_variance;
  options.hold = HoldModel::exact;
  options.delay = DelayModel::estimate;
  options.threads = threads;

  BlindFit out;
  const auto begin = std::chrono::steady_clock::now();
  ModeSelection selection;
  if (stage.missing_peaks > 0) selection.modes = peaks_left(stage);
  out.blind = automatic_fit(stage.frf, ModelStructure{}, selection, options);
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  FitOptions reference = options;
  reference.delay_s = stage.delay_s;
  reference.uncertainty = false;
  out.from_truth = fit_additive_model(stage.frf, stage.truth, reference);
  out.true_modes = static_cast<int>(modes_of(stage.truth).size());
  out.found_modes = static_cast<int>(modes_of(out.blind.model).size());
  out.excess_cost = out.blind.model.fit.cost / out.from_truth.model.fit.cost - 1.0;
  out.missed_hz = unmatched(stage.truth, out.blind.model);
  out.spurious_hz = unmatched(out.blind.model, stage.truth);
  out.success = out.excess_cost < kAllowedExcess && out.found_modes <= out.true_modes + 1;
  return out;
}

std::string BlindFit::report() const {
  std::string text = fmt::format(
      "{}: {} modes of {}, cost {:.6g} ({:+.3g} % of that from the truth, which is {:.6g}: {} {}), "
      "{} after {} iterations ({}), {:.2f} s\n",
      success ? "success" : "FAILURE", found_modes, true_modes, blind.model.fit.cost,
      100.0 * excess_cost, from_truth.model.fit.cost, to_string(from_truth.status()),
      from_truth.message(), to_string(blind.status()), blind.model.fit.iterations, blind.message(),
      seconds);
  for (const double f : missed_hz) text += fmt::format("  missed   {:.3f} Hz\n", f);
  for (const double f : spurious_hz) {
    for (const Submodel* s : modes_of(blind.model))
      if (s->natural_frequency_hz() == f)
        text +=
            fmt::format("  spurious {:.3f} Hz (damping {:.3g} %)\n", f, 100.0 * s->damping_ratio());
  }
  for (const std::string& decision : blind.decisions) text += "  | " + decision + "\n";
  return text;
}

}  // namespace stageid::test
