#include "frf/hold_compensation.hpp"

#include <cmath>
#include <complex>
#include <stdexcept>

namespace stageid {
namespace {

/// sin(x) / x.
double sinc(double x) { return x == 0.0 ? 1.0 : std::sin(x) / x; }

void check_request(const FrfEstimate& frf, double delay_s) {
  if (frf.compensated != Compensation::none) {
    throw std::invalid_argument(
        "compensate: the response was compensated already; start from the one as measured");
  }
  if (!(frf.sample_rate_hz > 0.0) || !std::isfinite(frf.sample_rate_hz)) {
    throw std::invalid_argument(
        "compensate: the sample rate is unknown; the hold lasts one sample, so give "
        "sample_rate_hz");
  }
  if (frf.hold == Hold::none) {
    throw std::invalid_argument(
        "compensate: the response has no zero-order hold (hold = none); there is nothing to take "
        "out");
  }
  if (!std::isfinite(delay_s)) {
    throw std::invalid_argument("compensate: delay_s must be a finite number of seconds");
  }
}

}  // namespace

FrfEstimate compensate(const FrfEstimate& frf, Compensation kind, double delay_s) {
  if (kind == Compensation::none) return frf;
  check_request(frf, delay_s);
  const double T = 1.0 / frf.sample_rate_hz;
  const Eigen::VectorXd omega = frf.omega_rad_s();

  FrfEstimate result = frf;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    // (1 - e^{-j omega T}) / (j omega T) = e^{-j omega T / 2} sinc(omega T / 2): both kinds turn by
    // the same angle, and only `hold` changes the magnitude.
    const double gain = kind == Compensation::hold ? 1.0 / sinc(0.5 * omega[k] * T) : 1.0;
    result.response.col(k) *= std::polar(gain, omega[k] * (delay_s + 0.5 * T));
    const double power = gain * gain;
    for (Eigen::MatrixXd* variance :
         {&result.noise_variance, &result.total_variance, &result.residual_covariance_re,
          &result.residual_covariance_im}) {
      if (variance->size() != 0) variance->col(k) *= power;
    }
    if (result.covariance.size() != 0) result.covariance.col(k) *= power;
  }
  if (kind == Compensation::hold) result.hold = Hold::none;
  result.compensated = kind;
  result.delay_s = delay_s;
  return result;
}

}  // namespace stageid
