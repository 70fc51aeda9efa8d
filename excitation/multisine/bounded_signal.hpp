#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstdint>
#include <limits>
#include <string>

#include "excitation/multisine/frequency_grid.hpp"

namespace stageid {

/// What of a channel is bounded.
enum class SignalKind : std::uint8_t {
  value,       ///< x
  difference,  ///< (x[n] - x[n-1]) fs: slew, as a digital limit sees it
  derivative   ///< dx/dt: velocity
};

/// A signal of the closed loop that must stay inside its limits. Linear in the excitation:
/// X(l) = sum_p transfer(p, l) R_p(l), times what `kind` says.
struct BoundedSignal {
  std::string name;
  SignalKind kind = SignalKind::value;
  Eigen::MatrixXcd transfer;    ///< axes x lines, from the excitation of each axis to the value
  Eigen::MatrixXcd below_band;  ///< the same on below_band_hz(grid); empty: as on the first line
  double rest_margin = 0.0;     ///< added to the peak from rest, a share of it
  double below_band_doubt =
      0.0;  ///< of what lies below the band, that share of its peak is added too
  double peak_limit = std::numeric_limits<double>::infinity();
  double rms_limit = std::numeric_limits<double>::infinity();
  double rms_time_constant_s = 0.0;  ///< of the rms limit's exponential window; 0: over a period
  double reserve = 0.0;  ///< of the peak limit, left to noise and to what is not in the excitation
};

/// Half, one, one and a half ... of the grid's resolution, below its first line: where the first period
/// from rest has power that the lines do not show.
Eigen::VectorXd below_band_hz(const FrequencyGrid& grid);

/// What `kind` makes of exp(j 2 pi f t): 1, (1 - exp(-j 2 pi f / fs)) fs, or j 2 pi f.
std::complex<double> kind_factor(SignalKind kind, double frequency_hz, double sample_rate_hz);

/// Largest rms of a periodic signal over an exponential window, in steady state.
double windowed_rms(const Eigen::Ref<const Eigen::VectorXd>& period, double sample_rate_hz,
                    double time_constant_s);

}  // namespace stageid
