#pragma once

#include <Eigen/Core>
#include <array>
#include <complex>
#include <cstdint>
#include <limits>
#include <string>

#include "excitation/multisine/frequency_grid.hpp"
#include "excitation/words/words.hpp"

namespace stageid {

/// The quantity of a channel that is bounded.
enum class SignalKind : std::uint8_t {
  value,       ///< x
  difference,  ///< (x[n] - x[n-1]) fs: slew as a digital limit computes it
  derivative   ///< dx/dt: velocity
};
template <>
inline constexpr std::array kWords<SignalKind> = {"value", "slew", "velocity"};

/// A signal of the closed loop with limits. It is linear in the excitation:
/// X(l) = sum_p transfer(p, l) R_p(l), times kind_factor().
struct BoundedSignal {
  std::string name;
  SignalKind kind = SignalKind::value;
  Eigen::MatrixXcd transfer;    ///< axes x lines, from the excitation of each axis to the value
  Eigen::MatrixXcd below_band;  ///< the same on below_band_hz(grid); empty: as on the first line
  double rest_margin = 0.0;     ///< share of the peak from rest, added to it
  /// The part of the peak from rest below the band is uncertain: this share of it is added too.
  double below_band_doubt = 0.0;
  double peak_limit = std::numeric_limits<double>::infinity();
  double rms_limit = std::numeric_limits<double>::infinity();
  double rms_time_constant_s = 0.0;  ///< of the rms limit's exponential window; 0: one period
  double reserve = 0.0;  ///< of the peak limit, left for noise and other unpredicted parts
};

/// Multiples of half the grid's resolution, below its first line: the first period from rest has power there.
Eigen::VectorXd below_band_hz(const FrequencyGrid& grid);

/// Factor that `kind` applies to exp(j 2 pi f t): 1, (1 - exp(-j 2 pi f / fs)) fs, or j 2 pi f.
std::complex<double> kind_factor(SignalKind kind, double frequency_hz, double sample_rate_hz);

/// Largest rms of a periodic signal over an exponential window, in steady state.
double windowed_rms(const Eigen::Ref<const Eigen::VectorXd>& period, double sample_rate_hz,
                    double time_constant_s);

}  // namespace stageid
