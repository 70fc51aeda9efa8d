#include "excitation/multisine/bounded_signal.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stageid {

Eigen::VectorXd below_band_hz(const FrequencyGrid& grid) {
  const Eigen::Index halves = 2 * static_cast<Eigen::Index>(grid.lines().front()) - 1;
  Eigen::VectorXd frequency_hz(halves);
  for (Eigen::Index i = 0; i < halves; ++i)
    frequency_hz[i] = 0.5 * static_cast<double>(i + 1) * grid.resolution_hz();
  return frequency_hz;
}

std::complex<double> kind_factor(SignalKind kind, double frequency_hz, double sample_rate_hz) {
  const double omega_rad_s = 2.0 * std::numbers::pi * frequency_hz;
  switch (kind) {
    case SignalKind::value:
      break;
    case SignalKind::difference:
      return (1.0 - std::polar(1.0, -omega_rad_s / sample_rate_hz)) * sample_rate_hz;
    case SignalKind::derivative:
      return {0.0, omega_rad_s};
  }
  return 1.0;
}

double windowed_rms(const Eigen::Ref<const Eigen::VectorXd>& period, double sample_rate_hz,
                    double time_constant_s) {
  double mean_square = period.squaredNorm() / static_cast<double>(period.size());
  if (time_constant_s <= 0.0) return std::sqrt(mean_square);
  const double a = std::exp(-1.0 / (sample_rate_hz * time_constant_s));
  double largest = mean_square;
  // The first pass settles the window to within the ripple of one period; the second is evaluated.
  for (int pass = 0; pass < 2; ++pass)
    for (const double value : period) {
      mean_square = a * mean_square + (1.0 - a) * value * value;
      largest = std::max(largest, mean_square);
    }
  return std::sqrt(largest);
}

}  // namespace stageid
