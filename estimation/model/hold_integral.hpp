#pragma once

#include <complex>

namespace stageid {

/// phi(t) = integral of e^{lambda v} over [0, t] = (e^{lambda t} - 1)/lambda and its derivative to lambda:
/// the response of a pole to an input held for the time t. For lambda = 0: t and t^2/2.
struct HoldIntegral {
  std::complex<double> value;
  std::complex<double> derivative;
};
HoldIntegral hold_integral(std::complex<double> lambda, double t);

/// A delay in samples, 0 <= fraction < 1.
struct SplitDelay {
  double whole = 0.0;
  double fraction = 0.0;
};

/// Splits delay_s / period_s. Values within 1e-12 of an integer are rounded: the last bit of a sum of delays must not
/// decide whether a held input arrives one sample later.
SplitDelay split_delay(double delay_s, double period_s);

}  // namespace stageid
