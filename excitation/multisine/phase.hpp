#pragma once

#include <complex>
#include <numbers>

namespace stageid {

/// The phase of a complex number in [0, 2 pi).
inline double positive_phase_rad(const std::complex<double>& value) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double phase = std::arg(value);
  const double positive = phase < 0.0 ? phase + kTurn : phase;
  return positive < kTurn ? positive : 0.0;  // a tiny negative phase is rounded up to a full turn
}

}  // namespace stageid
