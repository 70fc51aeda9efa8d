#include "frf/runs/run_spectra.hpp"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "frf/runs/dropped_periods.hpp"
#include "frf/runs/health_gathering.hpp"
#include "frf/runs/run_steps.hpp"

namespace stageid {
namespace {

/// Largest number of periods that are compared and averaged together; limits the memory for their spectra.
constexpr int kMostTogether = 16;

/// One run in progress.
class RunMeasurement {
 public:
  RunMeasurement(const UsedRun& used, const SpectrumLines& lines, const ChannelChoice& channels,
                 PeriodChoice choice, RunWorkspace& workspace)
      : used_(used),
        lines_(lines),
        channels_(channels),
        w_(workspace),
        dropped_(used, lines, channels, workspace) {
    // Groups of equal size: outliers cannot be found in a last group of one or two periods.
    const int groups = (used.periods + kMostTogether - 1) / kMostTogether;
    together_ = (used.periods + groups - 1) / groups;
    compare_ = choice == PeriodChoice::consistent && together_ >= 3;
    const auto n_lines = std::ssize(lines.lines);
    const auto n = static_cast<Eigen::Index>(channels.outputs.size() + channels.estimated.size());
    w_.spectra.resize(together_);
    for (Eigen::MatrixXcd& spectrum : w_.spectra) spectrum.resize(n, n_lines);
    if (compare_) w_.record.resize(together_);
    w_.deviation_re.resize(n);
    w_.deviation_im.resize(n);
    w_.excluded_sum.setZero(w_.dft.length(), std::ssize(channels.excluded));
    run_.mean.setZero(n, n_lines);
    if (used.periods < 2) return;
    run_.slope.setZero(n, n_lines);
    const auto outputs = std::ssize(channels.outputs);
    run_.common_sum.setZero(outputs, noise_blocks(static_cast<Eigen::Index>(lines.excited)));
    run_.own_sum = run_.common_sum;
    run_.scatter_re = w_.pool.take(n * (n + 1) / 2, n_lines);
    run_.scatter_im = w_.pool.take(n * (n + 1) / 2, n_lines);
  }

  /// Adds the period in workspace.samples. @returns its spectra
  const Eigen::MatrixXcd& take(int period) {
    ++unmarked_;
    Eigen::MatrixXcd& spectra = w_.spectra[waiting_.size()];
    line_spectra(w_.samples.sensors, channels_.outputs, lines_.lines, 0, w_.dft, spectra);
    line_spectra(w_.samples.actuators, channels_.estimated, lines_.lines,
                 std::ssize(channels_.outputs), w_.dft, spectra);
    if (compare_) dropped_.keep_samples(waiting_.size());
    waiting_.push_back(period);
    for (std::size_t c = 0; c < channels_.excluded.size(); ++c)
      w_.excluded_sum.col(c) += w_.samples.actuators.col(channels_.excluded[c]);
    if (static_cast<int>(waiting_.size()) == together_) include_waiting();
    return spectra;
  }
  void leave_out(int period, const std::string& why) { run_.drop(used_.run(), period, why); }

  RunSpectra finish() {
    include_waiting();
    if (run_.periods == 0) return std::move(run_);
    run_.scatter_dof = run_.periods - 1;
    finish_slope();
    run_.excluded_power = excluded_power(lines_.excited_lines(), unmarked_, w_);
    return std::move(run_);
  }

 private:
  void include_waiting() {
    const std::vector<char> in =
        compare_ ? dropped_.settle(waiting_, run_) : std::vector<char>(waiting_.size(), 1);
    std::vector<const Eigen::MatrixXcd*> periods;
    std::vector<double> numbers;
    for (std::size_t i = 0; i < waiting_.size(); ++i) {
      if (in[i] == 0) continue;
      periods.push_back(&w_.spectra[i]);
      numbers.push_back(waiting_[i]);
      sum_of_numbers_ += waiting_[i];
      sum_of_squares_ += static_cast<double>(waiting_[i]) * waiting_[i];
    }
    for (Eigen::Index k = 0; k < run_.mean.cols(); ++k) {
      include_line(periods, k);
      for (std::size_t i = 0; i < periods.size() && run_.slope.size() > 0; ++i)
        run_.slope.col(k) += numbers[i] * periods[i]->col(k);
    }
    compare_lines(periods);
    run_.periods += static_cast<int>(periods.size());
    waiting_.clear();
  }

  /// Adds to common_sum and own_sum. Two periods share the scatter of each line equally.
  void compare_lines(const std::vector<const Eigen::MatrixXcd*>& periods) {
    const auto P = std::ssize(periods);
    if (P < 3) return;
    const Eigen::Index outputs = run_.common_sum.rows();
    const auto excited = static_cast<Eigen::Index>(lines_.excited);
    Eigen::MatrixXcd deviation(outputs, P);
    Eigen::ArrayXXd share(outputs, P);
    Eigen::ArrayXXd sum = Eigen::ArrayXXd::Zero(outputs, P);
    for (Eigen::Index k = 0; k < excited; ++k) {
      for (Eigen::Index p = 0; p < P; ++p) deviation.col(p) = periods[p]->col(k).head(outputs);
      const Eigen::VectorXcd mean = deviation.rowwise().mean();
      deviation.colwise() -= mean;
      share = deviation.array().abs2();
      const Eigen::ArrayXd scatter = share.rowwise().sum() + 1e-300;
      share = share.colwise() / scatter - 1.0 / static_cast<double>(P);
      const Eigen::Index block = noise_block(k, excited);
      run_.own_sum.col(block).array() += share.square().rowwise().sum();
      sum += share;
      if (k + 1 < excited && noise_block(k + 1, excited) == block) continue;
      run_.common_sum.col(block).array() += sum.square().rowwise().sum();
      sum.setZero();
    }
  }

  /// Converts sum_p p Z_p to the slope. With few and small p, rounding is far below the noise.
  void finish_slope() {
    const double mean = sum_of_numbers_ / run_.periods;
    run_.slope_spread = sum_of_squares_ - run_.periods * mean * mean;
    if (run_.periods < 2 || run_.slope.size() == 0) {
      run_.slope.resize(0, 0);
      return;
    }
    run_.slope = (run_.slope - sum_of_numbers_ * run_.mean) / run_.slope_spread;
  }

  /// Adds periods to mean and scatter of one line by Welford's recursion. A difference of two large sums would lose the
  /// noise, 1e-6 of the signal, by rounding, and might make the diagonal negative. Lines are processed one by one, so
  /// that the scatter stays in the cache.
  void include_line(const std::vector<const Eigen::MatrixXcd*>& periods, Eigen::Index k) {
    const bool scatter = run_.scatter_re.size() > 0;
    if (scatter && run_.periods == 0) {
      w_.scatter_re.setZero(run_.scatter_re.rows());
      w_.scatter_im.setZero(run_.scatter_im.rows());
    } else if (scatter) {
      w_.scatter_re = run_.scatter_re.col(k);
      w_.scatter_im = run_.scatter_im.col(k);
    }
    const Eigen::Index n = run_.mean.rows();
    int count = run_.periods;
    for (const Eigen::MatrixXcd* spectra : periods) {
      const double inverse_count = 1.0 / ++count;
      w_.deviation = spectra->col(k) - run_.mean.col(k);
      // By components, because the compiler does not vectorize complex numbers.
      Eigen::Map<Eigen::VectorXd>(reinterpret_cast<double*>(run_.mean.col(k).data()), 2 * n) +=
          Eigen::Map<const Eigen::VectorXd>(reinterpret_cast<const double*>(w_.deviation.data()),
                                            2 * n) *
          inverse_count;
      if (count < 2) continue;
      w_.deviation_re = w_.deviation.real();
      w_.deviation_im = w_.deviation.imag();
      add_outer_product(1.0 - inverse_count, w_.deviation_re, w_.deviation_im, w_.scatter_re.data(),
                        w_.scatter_im.data());
    }
    if (!scatter) return;
    run_.scatter_re.col(k) = w_.scatter_re;
    run_.scatter_im.col(k) = w_.scatter_im;
  }

  const UsedRun& used_;
  const SpectrumLines& lines_;
  const ChannelChoice& channels_;
  RunWorkspace& w_;
  DroppedPeriods dropped_;
  int together_ = 1;  // periods that are compared and included together
  bool compare_ = true;
  int unmarked_ = 0;
  double sum_of_numbers_ = 0.0;  // over the included periods
  double sum_of_squares_ = 0.0;
  std::vector<int> waiting_;  // periods whose spectra are in the workspace
  RunSpectra run_;
};

}  // namespace

RunSpectra measure_run(const UsedRun& used, const SpectrumLines& lines,
                       const ChannelChoice& channels, const Eigen::MatrixXd& excitation_period,
                       PeriodChoice choice, RunWorkspace& w, HealthPart* health,
                       const ReadDone& read_done) {
  RunMeasurement measurement(used, lines, channels, choice, w);
  Fingerprint fingerprint;
  add_matrix(fingerprint, excitation_period);
  std::optional<KnownSpectra> known;
  const auto take = [&](int p) {
    add_matrix(fingerprint, w.samples.actuators);
    add_matrix(fingerprint, w.samples.sensors);
    known.emplace(KnownSpectra{measurement.take(p), channels.outputs, channels.estimated, lines});
    return &*known;
  };
  if (health != nullptr) health->watch_start(used, lines.excited_lines(), channels.outputs, w);
  read_periods(used, excitation_period, w, health, read_done, take,
               [&](int p, const std::string& why) { measurement.leave_out(p, why); });
  RunSpectra run = measurement.finish();
  run.fingerprint = fingerprint.hex();
  return run;
}

void carry(Parcel& parcel, DroppedPeriod& one) {
  parcel(one.realization), parcel(one.experiment), parcel(one.period), parcel(one.reason);
}

void carry(Parcel& parcel, ReplacedSamples& one) {
  parcel(one.realization), parcel(one.experiment), parcel(one.period);
  parcel(one.first), parcel(one.samples), parcel(one.reason);
}

void carry(Parcel& parcel, RunSpectra& run) {
  parcel(run.mean), parcel(run.scatter_re), parcel(run.scatter_im), parcel(run.scatter_dof);
  parcel(run.line_dof), parcel(run.scatter_window), parcel(run.scatter_first);
  parcel(run.slope), parcel(run.slope_spread), parcel(run.common_sum), parcel(run.own_sum);
  parcel(run.periods), parcel(run.excluded_power), parcel(run.fingerprint);
  parcel(run.dropped), parcel(run.replaced), parcel(run.deviating);
}

void RunSpectra::drop(const LogRun& of, int period, std::string reason) {
  const auto at = std::ranges::upper_bound(dropped, period, {}, &DroppedPeriod::period);
  dropped.insert(at, {of.realization, of.experiment, period, std::move(reason)});
}

Eigen::MatrixXcd RunSpectra::scatter(Eigen::Index k) const {
  const Eigen::Index n = mean.rows();
  Eigen::MatrixXcd full(n, n);
  Eigen::Index entry = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j, ++entry) {
      full(i, j) = {scatter_re(entry, k), scatter_im(entry, k)};
      full(j, i) = std::conj(full(i, j));
    }
  }
  return full;
}

Eigen::Index noise_blocks(Eigen::Index lines) {
  return std::clamp<Eigen::Index>(lines / 64, 1, 16);
}

Eigen::Index noise_block(Eigen::Index k, Eigen::Index lines) {
  return k * noise_blocks(lines) / lines;
}

double common_scatter(const RunSpectra& run, Eigen::Index k, Eigen::Index l) {
  if (k == l || run.scatter_window == 0) return k == l ? 1.0 : 0.0;
  const Eigen::Index apart = std::abs(run.scatter_first[k] - run.scatter_first[l]);
  const double x =
      std::max(0.0, 1.0 - static_cast<double>(apart) / static_cast<double>(run.scatter_window));
  return x * (2.0 + x) / 3.0;
}

}  // namespace stageid
