#include "excitation/signal_peaks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "excitation/dft.hpp"
#include "excitation/line_spectrum.hpp"

namespace stageid {
namespace {

using Eigen::Index;

int twice(int samples) {
  if (samples > std::numeric_limits<int>::max() / 2)
    throw std::invalid_argument("excitation: the period is too long to be predicted from rest");
  return 2 * samples;
}

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

  /// Spectra of r in the first of two periods and nothing in the second, axes x twofold.half_size().
  Eigen::MatrixXcd begun_at_rest(const Eigen::MatrixXcd& spectrum) {
    const int N = grid.samples_per_period();
    Eigen::MatrixXcd begun(spectrum.rows(), twofold.half_size());
    for (Index p = 0; p < spectrum.rows(); ++p) {
      const Eigen::VectorXd r = sampled.samples(spectrum.row(p).transpose());
      const std::span<double> input = twofold.input();
      std::fill(input.begin(), input.end(), 0.0);
      std::copy(r.data(), r.data() + N, input.begin());
      const auto forward = twofold.forward();
      for (Index i = 0; i < begun.cols(); ++i)
        begun(p, i) = forward[static_cast<std::size_t>(i)] / (2.0 * N);
    }
    return begun;
  }

  double largest_from_rest(const BoundedSignal& signal, const Eigen::MatrixXcd& begun);

  const FrequencyGrid& grid;
  int oversampling;
  LineSpectrum dense;
  LineSpectrum sampled;
  RealDft twofold;
  double looseness;
};

double SignalPredictor::Work::largest_from_rest(const BoundedSignal& signal,
                                                const Eigen::MatrixXcd& begun) {
  const std::vector<int>& lines = grid.lines();
  Eigen::VectorXcd half(twofold.half_size());
  std::size_t next = 0;  // the first line at or above the bin
  for (Index i = 0; i < half.size(); ++i) {
    while (next < lines.size() && 2 * lines[next] < i) ++next;
    const std::size_t above = std::min(next, lines.size() - 1);
    const std::size_t below = next == 0 ? 0 : std::min(next, lines.size()) - 1;
    std::complex<double> x =
        (signal.transfer.col(static_cast<Index>(above)).transpose() * begun.col(i)).value();
    if (above != below) {
      const double t =
          (0.5 * static_cast<double>(i) - lines[below]) / (lines[above] - lines[below]);
      const std::complex<double> lower =
          (signal.transfer.col(static_cast<Index>(below)).transpose() * begun.col(i)).value();
      x = t * x + (1.0 - t) * lower;
    }
    half[i] = x * kind_factor(signal.kind, 0.5 * static_cast<double>(i) * grid.resolution_hz(),
                              grid.sample_rate_hz());
  }
  return twofold.inverse(half).head(grid.samples_per_period()).cwiseAbs().maxCoeff();
}

SignalPredictor::SignalPredictor(const FrequencyGrid& grid) {
  twice(grid.samples_per_period());  // refused before memory for it is asked for
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
