#include "frf/periods/period_slip.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <vector>

#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index kBlocks = 64;
constexpr Index kShortestBlock = 16;
constexpr int kNear = 4;           // shifts that are always tried
constexpr std::size_t kPeaks = 3;  // of the cross-correlation, beyond them
constexpr double kLeastGain = 1.5;
constexpr double kLeastRatioAlone = 10.0;
constexpr double kLeastRatioOfOne = 30.0;
constexpr double kWorthTrying = 4.0;  // ratio of the block powers of a channel
constexpr double kClearlyMore = 1.2;
constexpr double kDeviations = 8.0;

/// x[n] - r[(n + shift) mod N]
ArrayXd difference(const MatrixXd& later, const MatrixXd& earlier, Index channel, Index shift) {
  const Index N = later.rows();
  const Index s = ((shift % N) + N) % N;
  ArrayXd d = later.col(channel).array();
  d.head(N - s) -= earlier.col(channel).tail(N - s).array();
  d.tail(s) -= earlier.col(channel).head(s).array();
  return d;
}

/// Sums of squares over blocks of one channel's difference.
ArrayXd block_power(const ArrayXd& difference, Index blocks) {
  ArrayXd power(blocks);
  const Index N = difference.size();
  for (Index b = 0; b < blocks; ++b) {
    const Index first = b * N / blocks;
    power[b] = difference.segment(first, (b + 1) * N / blocks - first).square().sum();
  }
  return power;
}

Index blocks_of(Index N) { return std::clamp<Index>(N / kShortestBlock, 1, kBlocks); }

double floor_of(const MatrixXd& samples, Index channel) {
  return kPowerRounding * samples.col(channel).squaredNorm() + 1e-300;
}

/// Whether a shift of 2 ... 4 samples fits some block of a channel clearly better.
bool clearly_shifted(const MatrixXd& earlier, const MatrixXd& later, Index channel,
                     const ArrayXd& here) {
  for (Index shift = 2; shift <= kNear; ++shift)
    for (const Index s : {shift, -shift})
      if ((kWorthTrying * block_power(difference(later, earlier, channel, s), here.size()) < here)
              .any())
        return true;
  return false;
}

struct Suspicion {
  bool of_kind = false;  ///< of all channels of a kind
  bool of_one = false;   ///< of a single channel
};

/// Whether, in some block of one kind of channels, the earlier period shifted by a sample fits as well as the
/// period itself, or clearly better in one channel. This is always the case after a gap, and also if there is only
/// noise.
Suspicion suspicion(const MatrixXd& earlier, const MatrixXd& later) {
  const Index N = later.rows();
  const Index blocks = blocks_of(N);
  ArrayXd evidence = ArrayXd::Zero(blocks);
  bool one = false;
  for (Index c = 0; c < later.cols(); ++c) {
    const double least = floor_of(later, c);
    const ArrayXd here = block_power(difference(later, earlier, c, 0), blocks) + least;
    const ArrayXd next = block_power(difference(later, earlier, c, 1), blocks) + least;
    const ArrayXd last = block_power(difference(later, earlier, c, -1), blocks) + least;
    const ArrayXd ratio = next.min(last) / here;
    evidence += ratio.log();
    one = one || ratio.minCoeff() * kWorthTrying < 1.0 ||
          (ratio.minCoeff() < 1.0 && clearly_shifted(earlier, later, c, here));
  }
  return {later.cols() > 0 && (evidence <= 0.0).any(), one};
}

/// Residuals of one kind of channels without and with a shift, per sample, over the scatter of the channels.
struct Explained {
  ArrayXd before;        ///< sum over channels of e_0^2
  ArrayXd after;         ///<   and of e_d^2
  double freedom = 0.0;  ///< independent samples of a period, over the channels
  double noise = 0.0;    ///< of a sample, sum over channels: 1 each
};

/// Independent samples of a stationary signal: (sum S)^2 / sum S^2 over the lines of both signs of its spectrum S.
/// For white noise this is its length (Satterthwaite).
double independent_samples(const ArrayXd& signal, RealDft& dft) {
  double sum = 0.0;
  double squares = 0.0;
  for (const std::complex<double>& line : dft.forward(signal.matrix())) {
    const double power = std::norm(line);
    sum += power;
    squares += power * power;
  }
  return squares > 0.0 ? 2.0 * sum * sum / squares : 0.0;
}

Explained explained_of(const MatrixXd& earlier, const MatrixXd& later, Index c, Index shift,
                       RealDft& dft) {
  const Index N = later.rows();
  const Index blocks = blocks_of(N);
  const double power = later.col(c).squaredNorm();
  if (!(power > 0.0)) return {ArrayXd::Zero(N), ArrayXd::Zero(N)};
  const ArrayXd before = difference(later, earlier, c, 0);
  const ArrayXd after = difference(later, earlier, c, shift);
  const double scatter =
      block_power(before, blocks).min(block_power(after, blocks)).sum() / static_cast<double>(N);
  const double weight = 1.0 / (scatter + floor_of(later, c) / static_cast<double>(N));
  return {weight * before.square(), weight * after.square(),
          std::min(independent_samples(before, dft), independent_samples(after, dft)), 1.0};
}

struct ExplainedKind {
  std::vector<Explained> channels;
  Explained sum;
};

ExplainedKind explained(const MatrixXd& earlier, const MatrixXd& later, Index shift, RealDft& dft) {
  ExplainedKind kind{{}, {ArrayXd::Zero(later.rows()), ArrayXd::Zero(later.rows())}};
  for (Index c = 0; c < later.cols(); ++c) {
    const Explained& one = kind.channels.emplace_back(explained_of(earlier, later, c, shift, dft));
    kind.sum.before += one.before;
    kind.sum.after += one.after;
    kind.sum.freedom += one.freedom;
    kind.sum.noise += one.noise;
  }
  return kind;
}

struct Change {
  Index first = 0;  ///< rows first ... last - 1 are displaced
  Index last = 0;
  double gain = 0.0;
};

/// The part at the beginning or at the end of the period that a shift explains best.
Change best_change(const ArrayXd& gain) {
  Change best;
  const Index N = gain.size();
  double sum = 0.0;
  for (Index n = 0; n < N; ++n) {
    sum += gain[n];
    if (sum > best.gain) best = {0, n + 1, sum};
  }
  sum = 0.0;
  for (Index n = N; n-- > 0;) {
    sum += gain[n];
    if (sum >= best.gain && sum > 0.0) best = {n, N, sum};
  }
  return best;
}

/// Whether the rest of the period repeats without a shift, and the rows of `change` do not. A slow motion that does not
/// repeat may look like a shift in some rows, but it differs in all of them.
bool rest_repeats(const Explained& of, const Change& change) {
  const Index rows = change.last - change.first;
  const Index others = of.before.size() - rows;
  if (others == 0) return true;
  const double inside = of.before.segment(change.first, rows).sum();
  const double outside = of.before.sum() - inside;
  return kLeastRatioOfOne * outside * static_cast<double>(rows) <
         inside * static_cast<double>(others);
}

/// ln of the ratio by which the shifted period fits the rows of `change` better; 0 if it is not significant.
double advantage(const Explained& of, const Change& change) {
  const Index rows = change.last - change.first;
  const double count =
      of.freedom * static_cast<double>(rows) / static_cast<double>(of.before.size());
  if (!(count > 0.0)) return 0.0;
  // In a few rows, the steps of a coarse converter agree by chance: nothing fits better than the noise.
  const double noise = of.noise * static_cast<double>(rows);
  const double before = of.before.segment(change.first, rows).sum();
  const double after = of.after.segment(change.first, rows).sum();
  const double ratio = std::log(std::max(noise, before) / std::max(noise, after));
  const double least = std::max(std::log(kLeastGain), kDeviations * std::sqrt(4.0 / count));
  return std::abs(ratio) > least ? ratio : 0.0;
}

/// Adds the cross-spectrum; all lines of all channels have the same weight.
void add_peaks(const MatrixXd& earlier, const MatrixXd& later, RealDft& dft,
               Eigen::VectorXcd& correlation) {
  for (Index c = 0; c < later.cols(); ++c) {
    const auto X = dft.forward(later.col(c));
    const std::vector<std::complex<double>> of_later(X.begin(), X.end());
    const auto R = dft.forward(earlier.col(c));
    for (Index l = 1; l < correlation.size(); ++l) {
      const std::complex<double> product = std::conj(R[l]) * of_later[l];
      const double size = std::abs(product);
      if (size > 0.0) correlation[l] += product / size;
    }
  }
}

std::vector<Index> shifts_to_try(const LogSamples& earlier, const LogSamples& later, RealDft& dft) {
  const Index N = dft.length();
  Eigen::VectorXcd spectrum = Eigen::VectorXcd::Zero(dft.half_size());
  add_peaks(earlier.sensors, later.sensors, dft, spectrum);
  add_peaks(earlier.actuators, later.actuators, dft, spectrum);
  const Eigen::VectorXd correlation = dft.inverse(spectrum);
  const auto at = [&](Index n) { return correlation[(n + N) % N]; };
  std::vector<Index> shifts;
  for (Index d = -kNear; d <= kNear; ++d)
    if (d != 0) shifts.push_back(d);
  std::vector<Index> peaks;
  // x[n] = r[n + d] has its peak at -d.
  for (Index n = kNear + 1; n < N - kNear; ++n)
    if (at(n) > at(n - 1) && at(n) >= at(n + 1)) peaks.push_back(n);
  const std::size_t count = std::min(kPeaks, peaks.size());
  std::partial_sort(peaks.begin(), peaks.begin() + static_cast<std::ptrdiff_t>(count), peaks.end(),
                    [&](Index a, Index b) { return at(a) > at(b); });
  for (std::size_t i = 0; i < count; ++i)
    for (const Index beside : {-1, 0, 1})
      shifts.push_back((peaks[i] <= N / 2 ? -peaks[i] : N - peaks[i]) + beside);
  return shifts;
}

}  // namespace

std::optional<PeriodSlip> find_slip(const LogSamples& earlier, const LogSamples& later,
                                    RealDft& dft) {
  const Suspicion of_y = suspicion(earlier.sensors, later.sensors);
  const Suspicion of_u = suspicion(earlier.actuators, later.actuators);
  const bool of_kind = of_y.of_kind || of_u.of_kind;
  const bool of_single = of_y.of_one || of_u.of_one;
  if (!of_kind && !of_single) return std::nullopt;
  const Index N = later.sensors.rows();
  std::optional<PeriodSlip> found;
  double largest = 0.0;
  std::optional<PeriodSlip> of_one;  // of a single channel
  double largest_of_one = 0.0;
  for (const Index shift : shifts_to_try(earlier, later, dft)) {
    const ExplainedKind sensors = explained(earlier.sensors, later.sensors, shift, dft);
    const ExplainedKind actuators = explained(earlier.actuators, later.actuators, shift, dft);
    const ArrayXd of_sensors = sensors.sum.before - sensors.sum.after;
    const ArrayXd of_actuators = actuators.sum.before - actuators.sum.after;
    const std::array<ArrayXd, 3> gains = {of_sensors + of_actuators, of_sensors, of_actuators};
    const bool near = std::abs(shift) <= kNear;
    const auto slip_of = [&](const Change& change, bool y, bool u) {
      const bool until_the_end = change.last == N;
      return PeriodSlip{until_the_end ? change.first : change.last, static_cast<int>(shift),
                        !until_the_end, y, u};
    };
    for (const ArrayXd& gain : gains) {
      const Change change = best_change(gain);
      if (!of_kind || !(change.gain > largest)) continue;
      const double y = advantage(sensors.sum, change);
      const double u = advantage(actuators.sum, change);
      // A transient or a stuck sensor may look like a long shift. With a wrong period length, every period is
      // displaced as a whole.
      const bool whole = change.first == 0 && change.last == N;
      const double sure = std::log(kLeastRatioAlone);
      if (near ? !(std::min(y, u) > 0.0) && std::max(y, u) < sure : whole || std::min(y, u) < sure)
        continue;
      // If one kind is not significant, it is assumed to have the same gap as the other.
      found = slip_of(change, y >= 0.0, u >= 0.0);
      largest = change.gain;
    }
    if (!near || !of_single) continue;
    const auto try_one = [&](const Explained& channel, Index c, bool of_sensor) {
      const Change change = best_change(channel.before - channel.after);
      if (!(change.gain > largest_of_one) ||
          advantage(channel, change) < std::log(kLeastRatioOfOne) || !rest_repeats(channel, change))
        return;
      of_one = slip_of(change, of_sensor, !of_sensor);
      of_one->channel = c;
      largest_of_one = change.gain;
    };
    for (Index c = 0; c < later.sensors.cols(); ++c) try_one(sensors.channels[c], c, true);
    for (Index c = 0; c < later.actuators.cols(); ++c) try_one(actuators.channels[c], c, false);
  }
  return of_one && largest_of_one > kClearlyMore * largest ? of_one : found;
}

}  // namespace stageid
