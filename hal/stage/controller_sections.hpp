#pragma once

#include <complex>
#include <vector>

#include "hal/stage/motion_controller.hpp"

namespace stageid {

/// (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2)
struct BiquadSection {
  double b0 = 1.0;
  double b1 = 0.0;
  double b2 = 0.0;
  double a1 = 0.0;
  double a2 = 0.0;

  std::complex<double> response(std::complex<double> z_inverse) const {
    return (b0 + z_inverse * (b1 + z_inverse * b2)) / (1.0 + z_inverse * (a1 + z_inverse * a2));
  }
};

/// Discretizes C(s) of an axis by Tustin's method: one section of integrator and lead (with the gain), one of
/// the low pass, and one per notch. Prewarped at the crossover; notches at their own frequency.
/// @throws std::invalid_argument for frequencies at or above the Nyquist frequency, negative or not
///         finite values, a lead without pole (not proper), or an undamped pole.
std::vector<BiquadSection> controller_sections(const AxisController& axis, double sample_rate_hz);

/// Sections of second order in series with the given transfer function.
/// @throws std::invalid_argument unless the coefficients are finite, the denominator is not zero, and the numerator has
/// at most its degree (causal)
std::vector<BiquadSection> transfer_sections(const ControllerTransfer& transfer);

}  // namespace stageid
