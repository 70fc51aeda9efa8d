#include "frf/runs/dropped_periods.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "frf/periods/bridge.hpp"
#include "frf/runs/run_steps.hpp"

namespace stageid {
namespace {

using Eigen::Index;

/// Largest part of a period that is replaced. What replaces it has less noise: docs/theory.md, section 3.
constexpr double kLargestGap = 0.1;

}  // namespace

void DroppedPeriods::keep_samples(std::size_t place) {
  const auto n_y = std::ssize(channels_.outputs);
  const auto n = n_y + std::ssize(channels_.estimated);
  Eigen::MatrixXd& first = w_.first_samples;
  Eigen::MatrixXf& kept = w_.record[place];
  kept.resize(w_.dft.length(), n);
  first.resize(kept.rows(), kept.cols());
  for (Index c = 0; c < n; ++c) {
    const Eigen::Ref<const Eigen::VectorXd> samples =
        c < n_y ? w_.samples.sensors.col(channels_.outputs[c])
                : w_.samples.actuators.col(channels_.estimated[c - n_y]);
    if (place == 0) first.col(c) = samples;
    kept.col(c) = (samples - first.col(c)).cast<float>();
  }
}

// Each replacement makes the others more visible, and may not be enough.
std::vector<char> DroppedPeriods::settle(const std::vector<int>& numbers, RunSpectra& run) {
  const std::size_t P = numbers.size();
  const ComparedPeriods compared{std::span<const Eigen::MatrixXcd>(w_.spectra).first(P),
                                 std::span<const Eigen::MatrixXf>(w_.record).first(P), numbers,
                                 frequencies_hz(used_.log->info(), lines_.excited_lines()),
                                 used_.log->info().sample_rate_hz};
  std::vector<IndexRange> replaced(P);
  std::vector<std::string> reasons(P);  // before anything was replaced
  PeriodOutliers outliers;
  bool changed = true;
  while (changed) {
    outliers = find_outliers(compared);
    changed = false;
    for (const PeriodOutlier& outlier : outliers.found) {
      const std::size_t p = outlier.period;
      if (reasons[p].empty()) reasons[p] = reason(outlier);
      // As with dropped ones, the others must be the majority.
      const auto others = std::ranges::count(replaced, false, &IndexRange::empty);
      if (!replaced[p].empty() || others < (std::ssize(numbers) - 1) / 2)
        changed |= replace(outlier, outliers.consistent, replaced[p]);
    }
  }
  const LogRun& of = used_.run();
  std::vector<char> use(P, 1);
  for (const PeriodOutlier& outlier : outliers.found) {
    use[outlier.period] = 0;
    run.deviating.push_back(numbers[outlier.period]);
    run.drop(of, numbers[outlier.period], reasons[outlier.period]);
  }
  for (std::size_t p = 0; p < P; ++p) {
    if (use[p] == 0 || replaced[p].empty()) continue;
    run.deviating.push_back(numbers[p]);
    run.replaced.push_back({of.realization, of.experiment, numbers[p],
                            static_cast<int>(replaced[p].first),
                            static_cast<int>(replaced[p].count()), reasons[p]});
  }
  return use;
}

/// Replaces the samples that deviate. If this is not enough, the next call replaces at least twice as many.
/// @returns false if there would be too many, or if they reach an end of the period; nothing has changed then
bool DroppedPeriods::replace(const PeriodOutlier& outlier,
                             const std::vector<std::size_t>& reference, IndexRange& replaced) {
  const auto N = static_cast<Index>(w_.dft.length());
  IndexRange range = outlier.where;
  if (range.empty() || reference.empty()) return false;
  if (!replaced.empty()) {
    const Index more = (replaced.count() + 1) / 2;
    range.include({replaced.first - more, replaced.end + more});
  }
  if (static_cast<double>(range.count()) > kLargestGap * static_cast<double>(N)) return false;
  if (range.first <= 0 || range.end >= N) return false;  // it began before, or goes on
  bridge(outlier.period, reference, range);
  replaced = range;
  return true;
}

void DroppedPeriods::bridge(std::size_t place, const std::vector<std::size_t>& reference,
                            IndexRange range) {
  Eigen::MatrixXf& period = w_.record[place];
  Eigen::MatrixXd change = -period.cast<double>();
  bridge_samples(w_.record, reference, place, range);
  change += period.cast<double>();
  Eigen::MatrixXcd& spectra = w_.spectra[place];
  Eigen::MatrixXcd difference(spectra.rows(), spectra.cols());
  line_spectra(change, first_indices(change.cols()), lines_.lines, 0, w_.dft, difference);
  spectra += difference;
}

std::string DroppedPeriods::reason(const PeriodOutlier& outlier) const {
  return fmt::format("{:.3g} times the scatter of the other periods on {}, {:.4g} ... {:.4g} Hz",
                     outlier.ratio, channels_.name(used_.log->info(), outlier.channel),
                     outlier.low_hz, outlier.high_hz);
}

}  // namespace stageid
