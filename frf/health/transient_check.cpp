#include "frf/health/transient_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <numbers>

#include "acquisition/files/counted.hpp"
#include "frf/health/health_measures.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kFalseAlarms = 0.005;  // probability per log
constexpr Index kReach = 2;             // lines on either side of a maximum
constexpr double kMemory = 0.6;         // see the header
constexpr double kLargestShift = 0.5;   // deviations
constexpr double kTolerable = 2.7;      // of the expected shift: 1.2 of a pole, see the header
constexpr double kNamed = 0.1;          // of the largest shift: smaller ones are its tails
constexpr double kAgreement = 0.5;      // explained part: half way between chance and certainty
constexpr double kSteady = 0.98;        // of consecutive periods: what rings longer is a drift

/// Noise of one period on each line, and the power of the start relative to it.
struct Lines {
  Eigen::VectorXd noise;
  Eigen::VectorXd start;   // power of B, sum over the runs
  Eigen::VectorXd excess;  // the same over its noise, mean over the runs
};

Lines lines_of(const StartEvidence& e) {
  const Index K = e.frequency_hz.size();
  Lines lines{Eigen::VectorXd::Zero(K), Eigen::VectorXd::Zero(K), Eigen::VectorXd::Zero(K)};
  for (const RunStart& run : e.runs) {
    lines.noise += run.noise;
    lines.start += run.start;
    lines.excess += run.start / (1.0 + 1.0 / run.periods);
  }
  const double runs = static_cast<double>(e.runs.size());
  lines.noise = (lines.noise / runs).cwiseMax(std::numeric_limits<double>::min());
  lines.excess = (lines.excess.array() / lines.noise.array()) / runs;
  return lines;
}

/// Lines on which the power of the start has a local maximum. Relative to the noise, there would be none around a
/// mode that rings so long that it dominates the scatter of the periods.
std::vector<Index> maxima(const Lines& lines) {
  std::vector<Index> found;
  for (Index k = 0; k < lines.start.size(); ++k) {
    const Index first = std::max<Index>(0, k - kReach);
    const Index last = std::min(lines.start.size() - 1, k + kReach);
    Index largest = 0;
    lines.start.segment(first, last - first + 1).maxCoeff(&largest);
    if (first + largest == k && lines.excess[k] > 1.0) found.push_back(k);
  }
  return found;
}

/// Regression of W on B over the runs: W = c B + noise, where c is one number for all runs.
class Regression {
 public:
  /// @param product B* W  @param power |B|^2, both sums over lines and sensors
  void add(std::complex<double> product, double power) {
    if (!(power > 0.0)) return;
    ++runs_;
    products_ += product;
    power_ += power;
    squares_ += std::norm(product) / power;
  }
  std::complex<double> slope() const { return products_ / power_; }
  /// Part of the component of W along B that the same c explains in all runs.
  double explained() const {
    return squares_ > 0.0 ? std::norm(products_) / (power_ * squares_) : 1.0;
  }
  /// Whether c differs from `expected`. @param by_memory size that noise with a memory explains
  double p_value(double expected, double by_memory) const {
    if (runs_ < 2 || !(squares_ > 0.0)) return 1.0;
    const double beyond = std::max(0.0, std::abs(slope() - expected) - by_memory);
    const double scatter =
        std::max(squares_ * (1.0 - explained()), kPowerRounding * squares_) / (runs_ - 1);
    return std::exp(log_tail_of_f(beyond * beyond * power_ / scatter, 1, runs_ - 1));
  }

 private:
  int runs_ = 0;
  std::complex<double> products_ = 0.0;
  double power_ = 0.0;
  double squares_ = 0.0;
};

/// The sums over one window.
class Window {
 public:
  Window(const StartEvidence& e, const Lines& lines, Index peak)
      : evidence_(e), peak_(peak), excess_(lines.excess[peak]) {
    const Index first = std::max<Index>(0, peak - kReach);
    const Index last = std::min(lines.noise.size() - 1, peak + kReach);
    for (const RunStart& run : e.runs) {
      std::complex<double> along = 0.0;
      std::complex<double> ending = 0.0;
      double start = 0.0;
      for (Index k = first; k <= last; ++k) {
        along += run.along[k] / lines.noise[k];
        ending += run.ending[k] / lines.noise[k];
        start += run.start[k] / lines.noise[k];
        starts_.push_back(run.start[k] / lines.noise[k]);
        first_power_ += run.first[k] / lines.noise[k];
        last_power_ += run.last[k] / lines.noise[k];
      }
      decay_.add(along, start);
      ending_.add(ending, start);
    }
  }

  /// The smaller p-value of the two tests, corrected for two tests.
  double p_value() const {
    return std::min(1.0, 2.0 * std::min(decay_.p_value(0.0, kMemory / excess_), p_of_decay()));
  }

  /// Whether the used periods change along a straight line, as with a drift, rather than as a transient of this ratio. Of
  /// two periods, this shows only in the period before them.
  bool straight(std::complex<double> q) const {
    const double P = evidence_.runs.front().periods;
    if (decay_.p_value(P / (P + 1.0), 0.0) >= kFalseAlarms && p_of_decay() >= kFalseAlarms)
      return true;
    if (P < 3) return false;
    const std::complex<double> ringing =
        (std::pow(q, P - 1.0) - std::pow(q, P)) /
        (1.0 - mean_of_powers(q, 1, evidence_.runs.front().periods));
    const std::complex<double> drifting = 2.0 / P * decay_.slope();
    return std::abs(ending_.slope() - drifting) < std::abs(ending_.slope() - ringing);
  }
  /// Whether the start decays by the same complex ratio in all runs, as every linear transient does.
  bool linear() const { return decay_.explained() > kAgreement; }

  /// Ratio q of the transient in consecutive periods.
  std::complex<double> ratio() const {
    const int P = evidence_.runs.front().periods;
    const std::complex<double> c = decay_.slope();
    std::complex<double> best = 0.0;
    double least = std::numeric_limits<double>::infinity();
    const auto look = [&](std::complex<double> q) {
      const double off =
          std::abs((q - mean_of_powers(q, 2, P)) / (1.0 - mean_of_powers(q, 1, P)) - c);
      if (off >= least) return;
      least = off;
      best = q;
    };
    // A coarse grid, then three finer ones around the best point.
    constexpr int kAngles = 48;
    for (int i = 1; i <= 80; ++i)
      for (int a = 0; a < kAngles; ++a)
        look(std::polar(std::exp(-0.1 * i), 2.0 * std::numbers::pi * a / kAngles));
    double reach = 1.0;
    for (int pass = 0; pass < 3; ++pass, reach /= 5.0) {
      const std::complex<double> centre = best;
      for (int i = -5; i <= 5; ++i)
        for (int a = -5; a <= 5; ++a) {
          const std::complex<double> q =
              centre * std::polar(std::exp(0.02 * reach * i), 0.03 * reach * a);
          if (std::abs(q) < 0.999) look(q);
        }
    }
    return best;
  }

  /// Shift of a parameter in standard deviations by the noise; see the header. @param used the periods' mean includes the
  /// start
  double shift(std::complex<double> q, bool used) const { return shift_with(q, used, 0.0); }

  /// The same in reported standard deviations, which include the scatter of the transient over the periods.
  double reported_shift(std::complex<double> q, bool used) const {
    const int P = evidence_.runs.front().periods;
    const int first = used ? 0 : 1;
    const std::complex<double> mean = mean_of_powers(q, first, P);
    double scatter = 0.0;
    for (int p = first; p <= P; ++p) scatter += std::norm(std::pow(q, p) / mean - 1.0);
    return shift_with(q, used, scatter / ((P + 1.0 - first) * (P - first)));
  }

  double frequency_hz() const { return evidence_.frequency_hz[peak_]; }

 private:
  /// @param scatter of the transient in the variance of the mean, relative to its power in the mean
  double shift_with(std::complex<double> q, bool used, double scatter) const {
    const int P = evidence_.runs.front().periods;
    const double averaged = used ? P + 1.0 : P;
    const double left =
        std::norm(mean_of_powers(q, used ? 0 : 1, P) / (1.0 - mean_of_powers(q, 1, P)));
    double sum = 0.0;
    for (const double start : starts_) {
      const double power = left * averaged * start;
      sum += power / (1.0 + scatter * power);
    }
    // Power over noise is a mean over the sensors; the real part has half of the noise.
    return std::sqrt(2.0 * static_cast<double>(evidence_.sensors) * sum);
  }

  /// Test 2: whether the first period differs more from the others than the last does.
  double p_of_decay() const {
    const int runs = static_cast<int>(evidence_.runs.size());
    if (evidence_.runs.front().periods < 3 || !(last_power_ > 0.0)) return 1.0;
    return std::exp(log_tail_of_f(first_power_ / last_power_, runs, runs));
  }

  std::complex<double> mean_of_powers(std::complex<double> q, int from, int to) const {
    std::complex<double> sum = 0.0;
    for (int p = from; p <= to; ++p) sum += std::pow(q, p);
    return sum / static_cast<double>(to - from + 1);
  }

  const StartEvidence& evidence_;
  Index peak_;
  double excess_;
  double first_power_ = 0.0;
  double last_power_ = 0.0;
  std::vector<double> starts_;  // power of B over its noise, of every run and line
  Regression decay_;            // of W on B
  Regression ending_;           // of V on B
};

/// A window with a finding.
struct Change {
  double frequency_hz;
  double shift;           // standard deviations by the noise
  double reported_shift;  // by noise and transient
  std::complex<double> ratio;

  /// Periods after which the shift is no longer reported.
  int periods_left() const {
    return std::max(1, static_cast<int>(std::ceil(std::log(shift / kLargestShift) /
                                                  -std::log(std::abs(ratio)))));
  }
};

/// "182, 71 and 3 more Hz": the largest first.
std::string names_of(std::vector<Change> changes) {
  std::ranges::stable_sort(changes, std::greater(), &Change::shift);
  std::vector<std::string> names;
  for (const Change& change : changes) names.push_back(fmt::format("{:.4g}", change.frequency_hz));
  return listed(names, kMostNamed) + " Hz";
}

}  // namespace

std::vector<Finding> check_start_transient(const StartEvidence& evidence) {
  if (evidence.runs.empty() || evidence.frequency_hz.size() == 0) return {};
  const bool start_used = evidence.runs.front().start_used;
  const Lines lines = lines_of(evidence);
  const std::vector<Index> peaks = maxima(lines);
  std::vector<Change> ringing;
  std::vector<Change> drifting;
  double settled = 0.0;  // the largest shift if the start is discarded
  bool linear = false;
  double least_p = 1.0;  // of the drifts
  for (const Index peak : peaks) {
    const Window window(evidence, lines, peak);
    const double p = window.p_value() * static_cast<double>(peaks.size());
    if (p >= kFalseAlarms) continue;
    const std::complex<double> q = window.ratio();
    const Change change{window.frequency_hz(), window.shift(q, start_used),
                        window.reported_shift(q, start_used), q};
    if (window.straight(q) || std::abs(q) > kSteady) {
      least_p = std::min(least_p, p);
      drifting.push_back(change);
      continue;
    }
    // A mode that rings at an end of the lines lies beside them and shifts no other.
    if (!window.linear())
      settled = std::max(settled, window.shift(q, false));
    else if (peak > 0 && peak + 1 < evidence.frequency_hz.size())
      settled = std::max(settled, window.reported_shift(q, false));
    if (change.shift <= kLargestShift) continue;
    ringing.push_back(change);
    linear = linear || window.linear();
  }
  std::vector<Finding> findings;
  if (!drifting.empty())
    findings.push_back({Severity::doubt, Cause::drift, "",
                        fmt::format("the response changes steadily during the runs at {}: a mode "
                                    "drifts",
                                    names_of(drifting)),
                        fmt::format("p = {:.1g}", least_p),
                        "let the stage warm up, or measure for a shorter time"});
  if (ringing.empty()) return findings;
  const Change& largest = std::ranges::max(ringing, {}, &Change::reported_shift);
  const int needed = evidence.transient_periods +
                     std::ranges::max(ringing, {}, &Change::periods_left).periods_left();
  // The bound is reached if all runs shift the mode alike. Their phases are random.
  const double expected = settled / std::sqrt(static_cast<double>(evidence.runs.size()));
  std::string figure = fmt::format(
      "shifts a mode by up to {:.2g} standard deviations; {:.2g} % remains after one more period",
      largest.reported_shift, 100.0 * std::abs(largest.ratio));
  if (start_used)
    figure += fmt::format("; {:.2g} standard deviations without the first one", settled);
  Finding finding{
      expected > kTolerable ? Severity::fault : Severity::doubt,
      Cause::unsettled,
      "",
      fmt::format("not settled: the transient of the start still rings at {} after {}",
                  names_of(ringing), counted(evidence.transient_periods, "period")),
      figure,
      needed <= evidence.transient_periods + evidence.periods - 2
          ? fmt::format("--transient-periods {}, or --method lpm; then fit again", needed)
          : fmt::format(
                "use --method lpm and fit again, or measure again with transient_periods: {}",
                needed)};
  // Without skipped periods, all poles of the loop ring at full size, and a window has no common ratio.
  if (!linear && evidence.transient_periods > 0) {
    finding.cause = Cause::limit_cycle;
    finding.what = fmt::format(
        "the loop oscillates at the start of the runs at {} and comes to rest, in each run in "
        "another way: a limit cycle, as coarse steps of the command or friction cause",
        names_of(ringing));
    finding.remedy = kRemedyOfLimitCycle;
  }
  findings.push_back(std::move(finding));
  return findings;
}

}  // namespace stageid
