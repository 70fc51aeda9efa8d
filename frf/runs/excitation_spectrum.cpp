#include "frf/runs/excitation_spectrum.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

constexpr double kSmallestLine = 1e-6;     // of the largest line of the channel
constexpr double kSmallestChannel = 1e-9;  // of the largest line of all channels: units may differ
constexpr double kRoundingMargin = 8.0;    // exp(-64): not reached by chance on any line
constexpr double kRoundingAtMost = 1e-2;   // a binary sequence has a large step but no rounding

/// Distance between neighbouring values of integer samples; tiny for real numbers. A few thousand samples contain
/// neighbouring values of a 16 bit code; finer codes do not matter here.
double smallest_step(const Eigen::VectorXd& samples) {
  constexpr Eigen::Index kEnough = 4096;
  std::vector<double> sorted(samples.data(), samples.data() + std::min(samples.size(), kEnough));
  std::sort(sorted.begin(), sorted.end());
  double step = sorted.back() - sorted.front();
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double distance = sorted[i] - sorted[i - 1];
    if (distance > 0.0) step = std::min(step, distance);
  }
  return step;
}

/// The same for numbers written with few decimal digits, whose step depends on the value: the rms of the step.
double step_of_digits(const Eigen::VectorXd& samples) {
  constexpr int kFewDigits = 7;  // float32 has more
  constexpr double kExact = 1e-9;
  for (int digits = 1; digits <= kFewDigits; ++digits) {
    double squares = 0.0;
    const bool rounded = std::ranges::all_of(samples, [&](double sample) {
      if (sample == 0.0) return true;
      const double step = std::pow(10.0, std::floor(std::log10(std::abs(sample))) + 1 - digits);
      squares += step * step;
      const double steps = sample / step;
      return std::abs(steps - std::round(steps)) <= kExact * std::abs(steps);
    });
    if (rounded) return std::sqrt(squares / static_cast<double>(samples.size()));
  }
  return 0.0;
}

Eigen::VectorXcd channel_spectrum(const Eigen::VectorXd& samples, RealDft& dft) {
  return Eigen::Map<const Eigen::VectorXcd>(dft.forward(samples).data(), dft.half_size()) /
         static_cast<double>(dft.length());
}

}  // namespace

bool ExcitationSpectrum::is_zippered() const {
  return channels.size() > 1 && std::ranges::all_of(only, [](Eigen::Index c) { return c >= 0; });
}

ExcitationSpectrum excitation_spectrum(const Eigen::MatrixXd& period, RealDft& dft) {
  const Eigen::Index last = (period.rows() + 1) / 2 - 1;  // below Nyquist
  Eigen::MatrixXcd spectra(dft.half_size(), period.cols());
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(period.cols());
  for (Eigen::Index c = 0; c < period.cols(); ++c) {
    if ((period.col(c).array() == period(0, c)).all()) continue;
    spectra.col(c) = channel_spectrum(period.col(c), dft);
    largest[c] = std::sqrt(spectra.col(c).segment(1, last).cwiseAbs2().maxCoeff());
  }

  ExcitationSpectrum result;
  constexpr Eigen::Index kNone = -2;
  constexpr Eigen::Index kSeveral = -1;
  std::vector<Eigen::Index> only(last + 1, kNone);
  for (Eigen::Index c = 0; c < period.cols(); ++c) {
    if (!(largest[c] > kSmallestChannel * largest.maxCoeff())) continue;
    const double step = std::max(smallest_step(period.col(c)), step_of_digits(period.col(c)));
    const double rounding = step / std::sqrt(12.0 * static_cast<double>(period.rows()));
    const double threshold =
        std::max(kSmallestLine * largest[c],
                 std::min(kRoundingMargin * rounding, kRoundingAtMost * largest[c]));
    bool any = false;
    for (Eigen::Index l = 1; l <= last; ++l) {
      if (std::norm(spectra(l, c)) <= threshold * threshold) continue;
      Eigen::Index& channel = only[l];
      channel = channel == kNone ? c : kSeveral;
      any = true;
    }
    if (any) result.channels.push_back(c);
  }
  for (int l = 1; l <= last; ++l) {
    if (only[l] == kNone) continue;
    result.lines.push_back(l);
    result.only.push_back(only[l]);
  }
  result.values.setZero(period.cols(), std::ssize(result.lines));
  for (const Eigen::Index c : result.channels)
    result.values.row(c) = spectra(result.lines, c).transpose();
  return result;
}

}  // namespace stageid
