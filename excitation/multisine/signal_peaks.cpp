#include "excitation/multisine/signal_peaks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "excitation/multisine/dft.hpp"
#include "excitation/multisine/line_spectrum.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

using Eigen::Index;

int twice(int samples) {
  require(samples <= std::numeric_limits<int>::max() / 2,
          "excitation: the period is too long to predict the response from rest; shorten it");
  return 2 * samples;
}

/// A signal's transfer at multiples of half the resolution: cubic interpolation between the four nearest known
/// points, constant beyond them. If h decays within a tenth of the period, the error is 1e-3; linear
/// interpolation would have an error of 2 %.
class HalfLines {
 public:
  HalfLines(const FrequencyGrid& grid, const BoundedSignal& signal) : signal_(signal) {
    for (Index i = 1; i <= signal.below_band.cols(); ++i) at_.push_back(i);
    for (const int line : grid.lines()) at_.push_back(2 * Index{line});
  }

  /// transfer . r at bin `i`
  std::complex<double> product(Index i, const Eigen::Ref<const Eigen::VectorXcd>& r) const {
    const auto next = std::ranges::lower_bound(at_, i) - at_.begin();
    const auto count = std::ssize(at_);
    if (next == count) return known(count - 1, r);
    if (next == 0 || at(next) == i) return known(next, r);
    const Index points = std::min(kPoints, count);
    const Index first = std::clamp<Index>(next - points / 2, 0, count - points);
    std::complex<double> sum = 0.0;
    for (Index p = first; p < first + points; ++p) {
      double weight = 1.0;
      for (Index q = first; q < first + points; ++q)
        if (q != p) weight *= static_cast<double>(i - at(q)) / static_cast<double>(at(p) - at(q));
      sum += weight * known(p, r);
    }
    return sum;
  }

 private:
  static constexpr Index kPoints = 4;

  Index at(Index node) const { return at_[node]; }
  std::complex<double> known(Index node, const Eigen::Ref<const Eigen::VectorXcd>& r) const {
    const Index below = signal_.below_band.cols();
    return node < below ? (signal_.below_band.col(node).transpose() * r).value()
                        : (signal_.transfer.col(node - below).transpose() * r).value();
  }

  const BoundedSignal& signal_;
  std::vector<Index> at_;
};

}  // namespace

void SignalPeak::include(const SignalPeak& other) {
  steady = std::max(steady, other.steady);
  from_rest = std::max(from_rest, other.from_rest);
  rms = std::max(rms, other.rms);
}

int dense_oversampling(const FrequencyGrid& grid) {
  const double wanted = 8.0 * grid.lines().back() / grid.samples_per_period();
  return std::max(1, static_cast<int>(std::ceil(wanted)));
}

struct SignalPredictor::Work {
  explicit Work(const FrequencyGrid& g)
      : grid(g),
        oversampling(dense_oversampling(g)),
        dense(g, oversampling),
        sampled(g),
        twofold(twice(g.samples_per_period())),
        looseness(1.0 / std::cos(std::numbers::pi * g.lines().back() /
                                 (static_cast<double>(oversampling) * g.samples_per_period()))) {}

  /// Spectra of r in the first of two periods, followed by one period of zeros; axes x twofold.half_size().
  Eigen::MatrixXcd begun_at_rest(const Eigen::MatrixXcd& spectrum) {
    const int N = grid.samples_per_period();
    Eigen::MatrixXcd begun(spectrum.rows(), twofold.half_size());
    for (Index p = 0; p < spectrum.rows(); ++p) {
      const Eigen::VectorXd r = sampled.samples(spectrum.row(p).transpose());
      const std::span<double> input = twofold.input();
      std::ranges::fill(input, 0.0);
      std::copy(r.data(), r.data() + N, input.begin());
      const auto forward = twofold.forward();
      for (Index i = 0; i < begun.cols(); ++i) begun(p, i) = forward[i] / (2.0 * N);
    }
    return begun;
  }

  /// Includes the margin and the share added for doubt below the band.
  double largest_from_rest(const BoundedSignal& signal, const Eigen::MatrixXcd& begun) {
    const HalfLines known(grid, signal);
    Eigen::VectorXcd half(twofold.half_size());
    for (Index i = 0; i < half.size(); ++i)
      half[i] = known.product(i, begun.col(i)) *
                kind_factor(signal.kind, 0.5 * static_cast<double>(i) * grid.resolution_hz(),
                            grid.sample_rate_hz());
    const auto largest = [&] {
      return twofold.inverse(half).head(grid.samples_per_period()).cwiseAbs().maxCoeff();
    };
    const double of_all = (1.0 + signal.rest_margin) * largest();
    if (!(signal.below_band_doubt > 0.0)) return of_all;
    const Index lowest = 2 * Index{grid.lines().front()};
    half.tail(half.size() - lowest).setZero();
    return of_all + signal.below_band_doubt * largest();
  }

  const FrequencyGrid& grid;
  int oversampling;
  LineSpectrum dense;
  LineSpectrum sampled;
  RealDft twofold;
  double looseness;
};

SignalPredictor::SignalPredictor(const FrequencyGrid& grid) {
  twice(grid.samples_per_period());  // rejects too long periods before allocating memory
  work_ = std::make_unique<Work>(grid);
}
SignalPredictor::~SignalPredictor() = default;

std::vector<SignalPeak> SignalPredictor::predict(const std::vector<BoundedSignal>& signals,
                                                 const Eigen::MatrixXcd& spectrum) {
  const FrequencyGrid& grid = work_->grid;
  const Eigen::VectorXd frequency_hz = grid.frequency_hz();
  const Eigen::MatrixXcd begun = work_->begun_at_rest(spectrum);
  std::vector<SignalPeak> peaks;
  for (const BoundedSignal& signal : signals) {
    Eigen::VectorXcd X(grid.size());
    for (Index k = 0; k < grid.size(); ++k)
      X[k] = kind_factor(signal.kind, frequency_hz[k], grid.sample_rate_hz()) *
             (signal.transfer.col(k).transpose() * spectrum.col(k)).value();
    const Eigen::VectorXd x = work_->dense.samples(X);
    SignalPeak peak;
    peak.steady = work_->looseness * x.cwiseAbs().maxCoeff();
    peak.rms =
        windowed_rms(x, grid.sample_rate_hz() * work_->oversampling, signal.rms_time_constant_s);
    peak.from_rest = work_->largest_from_rest(signal, begun);
    peaks.push_back(peak);
  }
  return peaks;
}

}  // namespace stageid
