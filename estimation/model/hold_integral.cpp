#include "estimation/model/hold_integral.hpp"

#include <cmath>

namespace stageid {

HoldIntegral hold_integral(std::complex<double> lambda, double t) {
  using Complex = std::complex<double>;
  const Complex x = lambda * t;
  if (std::abs(x) > 0.5) {
    const Complex e = std::exp(x);
    const Complex value = (e - 1.0) / lambda;
    return {value, (t * e - value) / lambda};
  }
  // Series, because the closed form cancels for slow poles. 0.5^18/18! is far below rounding.
  Complex term = 1.0;
  Complex value = 0.0;
  Complex derivative = 0.0;
  for (int n = 0; n < 18; ++n) {
    value += term / static_cast<double>(n + 1);
    derivative += term / static_cast<double>(n + 2);
    term *= x / static_cast<double>(n + 1);
  }
  return {t * value, t * t * derivative};
}

SplitDelay split_delay(double delay_s, double period_s) {
  constexpr double kWhole = 1e-12;  // samples
  const double samples = delay_s / period_s;
  const double nearest = std::round(samples);
  if (std::abs(samples - nearest) < kWhole) return {nearest, 0.0};
  const double whole = std::floor(samples);
  return {whole, samples - whole};
}

}  // namespace stageid
