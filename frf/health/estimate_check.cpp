#include "frf/health/estimate_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "frf/health/health_measures.hpp"
#include "frf/plant/zippered_fit.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

constexpr double kByChance = 1e-4;
constexpr double kEverywhere = 0.2;  // of the lines: then the cause is distortion, not resonances

struct Band {
  double low_hz = 0.0;
  double high_hz = 0.0;
  double largest = 0.0;
};

/// Neighbouring lines share data, so lines a few apart belong to one band.
std::vector<Band> doubtful_bands(const FrfEstimate& frf, Eigen::Index axes, Eigen::Index& lines) {
  const int dof = frf.realizations * static_cast<int>(axes) *
                  (zippered_window(static_cast<int>(axes)) - ZipperedFit::kRegressors);
  std::vector<Band> bands;
  Eigen::Index before = -axes - 1;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const double misfit = frf.interpolation_misfit[k];
    if (!(misfit > 1.0) || log_tail_of_f(misfit, dof, frf.noise_dof) > std::log(kByChance))
      continue;
    if (k - before > axes) bands.push_back({frf.frequency_hz[k], 0.0, 0.0});
    before = k;
    bands.back().high_hz = frf.frequency_hz[k];
    bands.back().largest = std::max(bands.back().largest, misfit);
    ++lines;
  }
  return bands;
}

/// "realization 1, experiment 2: 9.8 times ...; ", the largest difference first.
std::string named(std::vector<NoisyRun> runs) {
  std::ranges::stable_sort(runs, std::ranges::greater(),
                           [](const NoisyRun& run) { return std::abs(std::log(run.ratio)); });
  std::string text;
  for (std::size_t i = 0; i < std::min(runs.size(), kMostNamed); ++i)
    text +=
        fmt::format("realization {}, experiment {}: {:.2g} times the power of the others on {}; ",
                    runs[i].realization + 1, runs[i].experiment + 1, runs[i].ratio, runs[i].output);
  if (runs.size() > kMostNamed) text += fmt::format("{} more; ", runs.size() - kMostNamed);
  return text;
}

// Times the noise power of the others. Disturbances of a stage rarely reach it; a limit cycle stops at one run and not
// at the next.
constexpr double kLimitCycle = 100.0;

bool mostly_unsettled(const NonlinearityTest& test) {
  Eigen::Index unsettled = 0;
  for (Eigen::Index b = 0; b < test.settled_p_value.size(); ++b)
    unsettled += test.settled(b) ? 0 : 1;
  return 2 * unsettled > test.settled_p_value.size();
}

}  // namespace

std::vector<Finding> check_settling(const FrfEstimate& frf) {
  const NonlinearityTest& test = frf.nonlinearity;
  if (test.settled_p_value.size() == 0) return {};
  // The limit is divided by the number of bands (Bonferroni); otherwise, many bands would cause false alarms.
  const auto bands = static_cast<double>(test.settled_p_value.size());
  if (bands * test.settled_p_value.minCoeff() >= kUnsettledBelow) return {};
  std::string figure;
  for (Eigen::Index b = 0, end = 0; b < test.band_hz.rows(); b = end) {
    end = b + 1;
    if (test.settled(b)) continue;
    while (end < test.band_hz.rows() && !test.settled(end)) ++end;
    figure += fmt::format("{}{:.4g} ... {:.4g} Hz: p = {:.0e}", figure.empty() ? "" : ", ",
                          test.band_hz(b, 0), test.band_hz(end - 1, 1),
                          test.settled_p_value.segment(b, end - b).minCoeff());
  }
  return {{Severity::doubt, Cause::unsettled, "",
           "the records are not settled: they contain a transient, a drift or slow noise", figure,
           fmt::format("{}; linearity cannot be tested in these bands", kUnsettledRemedy)}};
}

int runs_with_discarded_start(const FrfEstimate& frf) {
  int starts = 0;
  int others = 0;  // dropped periods that do not follow from the start on
  const DroppedPeriod* last = nullptr;
  for (const DroppedPeriod& one : frf.dropped_periods) {
    const bool follows = last != nullptr && one.realization == last->realization &&
                         one.experiment == last->experiment && one.period == last->period + 1;
    if (one.period == 0) ++starts;
    if (one.period > 0 && !follows) ++others;
    last = one.period == 0 || follows ? &one : nullptr;
  }
  const bool most_runs = starts > 1 && 2 * starts > frf.realizations * frf.experiments;
  return most_runs && starts > others ? starts : 0;
}

std::vector<Finding> check_discarded_starts(const FrfEstimate& frf) {
  const int starts = runs_with_discarded_start(frf);
  if (starts == 0) return {};
  return {{Severity::doubt, Cause::unsettled, "",
           "not settled: the first used period of most runs differs from the later ones and was "
           "discarded; the transient of the start is not over",
           fmt::format("{} of {} runs", starts, frf.realizations * frf.experiments),
           "increase --transient-periods by one, or use --method lpm"}};
}

void withdraw_linearity_test(FrfEstimate& frf, const std::vector<Finding>& findings) {
  const bool explained = std::ranges::any_of(findings, [](const Finding& finding) {
    return finding.cause == Cause::drift || finding.cause == Cause::unsettled ||
           finding.cause == Cause::resolution ||
           (finding.severity == Severity::fault && !finding.realizations.empty());
  });
  NonlinearityTest& test = frf.nonlinearity;
  if (!explained || test.band_hz.rows() == 0) return;
  test.settled_p_value.setZero(test.band_hz.rows());
  for (Eigen::MatrixXd* p : {&test.p_value, &test.even.p_value, &test.odd.p_value}) p->setOnes();
}

std::vector<Finding> check_interpolation(const FrfEstimate& frf) {
  if (frf.interpolation_misfit.size() == 0 || !(frf.noise_dof > 0.0)) return {};
  Eigen::Index lines = 0;
  std::vector<Band> bands = doubtful_bands(frf, frf.n_inputs(), lines);
  if (bands.empty()) return {};
  std::ranges::stable_sort(bands, std::ranges::greater(), &Band::largest);
  std::string figure;
  for (std::size_t i = 0; i < std::min(bands.size(), kMostNamed); ++i)
    figure += fmt::format("{}{:.2g} times the noise at {:.4g} ... {:.4g} Hz", i == 0 ? "" : ", ",
                          bands[i].largest, bands[i].low_hz, bands[i].high_hz);
  if (bands.size() > kMostNamed)
    figure += fmt::format(" and in {} more bands", bands.size() - kMostNamed);
  const bool everywhere =
      static_cast<double>(lines) > kEverywhere * static_cast<double>(frf.lines());
  return {{Severity::doubt, Cause::interpolation, "",
           everywhere
               ? "the residual between the zippered lines exceeds the noise, because of distortion "
                 "or too few lines"
               : "resonances are too narrow for the zippered lines: the error of the response "
                 "exceeds its variance",
           figure,
           everywhere ? "lower the level, lengthen the period, or measure with orthogonal_dft"
                      : "lengthen the period, or measure with orthogonal_dft"}};
}

std::vector<Finding> check_experiment_noise(const FrfEstimate& frf,
                                            const std::vector<NoisyRun>& runs, bool start_known) {
  if (!(frf.experiment_noise_ratio > 1.0)) return {};
  Finding finding{
      Severity::doubt,
      Cause::uneven_noise,
      "",
      "the noise level differs between the experiments: each has its own variance, with fewer "
      "degrees of freedom than a common variance",
      named(runs) + fmt::format("up to {:.2g} times the power; {:.2g} degrees of freedom remain",
                                frf.experiment_noise_ratio, frf.noise_dof),
      "find out what disturbed these experiments; 'fit --weighting likelihood' uses the nearest "
      "common covariance"};
  // Noise has random phases on neighbouring lines, a limit cycle has not.
  if (frf.experiment_noise_ratio > kLimitCycle && mostly_unsettled(frf.nonlinearity)) {
    finding.severity = Severity::fault;
    finding.cause = Cause::limit_cycle;
    finding.what =
        "the loop oscillates by itself in some experiments: a limit cycle, as coarse steps of the "
        "command or friction cause";
    finding.remedy = kRemedyOfLimitCycle;
    if (!start_known) {
      finding.cause = Cause::unsettled;
      finding.what =
          "not settled: some experiments contain motion that does not repeat and is not noise, as "
          "the transient of the start";
      finding.remedy =
          "use --method lpm, or measure again with one more of periods and transient_periods";
    }
  }
  return {finding};
}

}  // namespace stageid
