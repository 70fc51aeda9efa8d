#include "frf/response/hold_compensation.hpp"

#include <cmath>
#include <complex>
#include <functional>
#include <stdexcept>

#include "frf/response/channel_tiles.hpp"

namespace stageid {
namespace {

/// sin(x) / x.
double sinc(double x) { return x == 0.0 ? 1.0 : std::sin(x) / x; }

void check_request(const FrfEstimate& frf, double delay_s) {
  if (frf.compensated != Compensation::none) {
    throw std::invalid_argument(
        "compensate: the response is already compensated; start from the measured one");
  }
  if (!(frf.sample_rate_hz > 0.0) || !std::isfinite(frf.sample_rate_hz)) {
    throw std::invalid_argument(
        "compensate: the sample rate is unknown; set sample_rate_hz, because the hold lasts one "
        "sample");
  }
  if (frf.hold == Hold::none) {
    throw std::invalid_argument(
        "compensate: the response has no zero-order hold (hold = none), so there is nothing to "
        "compensate");
  }
  if (!std::isfinite(delay_s)) {
    throw std::invalid_argument("compensate: delay_s must be a finite number of seconds");
  }
}

/// Multiplies the response by a factor per line, and its variances by the squared magnitude.
void multiply(FrfEstimate& frf, const std::function<std::complex<double>(double)>& factor) {
  const Eigen::VectorXcd values = frf.omega_rad_s().unaryExpr(factor);
  const auto [first, count] = frf.own();
  // Tile by tile, in any team: at the ends of vectors, complex products are rounded differently.
  for_each_own_tile(*frf.team, frf.response.rows(), [&](DataRange tile) {
    Eigen::MatrixXcd G = frf.response.middleRows(tile.first, tile.count);
    for (Eigen::Index k = 0; k < frf.lines(); ++k) G.col(k) *= values[k];
    frf.response.middleRows(tile.first, tile.count) = G;
  });
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const double power = std::norm(values[k]);
    for (Eigen::MatrixXd* variance : {&frf.noise_variance, &frf.total_variance})
      if (variance->size() != 0) variance->col(k).segment(first, count) *= power;
    for (Eigen::MatrixXcd* covariance : {&frf.residual_covariance, &frf.covariance})
      if (covariance->size() != 0) covariance->col(k) *= power;
  }
}

/// The factor that `kind` removes at omega: (1 - e^{-j omega T}) / (j omega T) = e^{-j omega T / 2}
/// sinc(omega T / 2). Both kinds have the same phase; only `hold` changes the magnitude.
std::complex<double> taken_out(Compensation kind, double delay_s, double T, double omega) {
  const double gain = kind == Compensation::hold ? sinc(0.5 * omega * T) : 1.0;
  return std::polar(gain, -omega * (delay_s + 0.5 * T));
}

}  // namespace

FrfEstimate compensate(const FrfEstimate& frf, Compensation kind, double delay_s) {
  if (kind == Compensation::none) return frf;
  check_request(frf, delay_s);
  const double T = 1.0 / frf.sample_rate_hz;
  FrfEstimate result = frf;
  multiply(result, [&](double omega) { return 1.0 / taken_out(kind, delay_s, T, omega); });
  if (kind == Compensation::hold) result.hold = Hold::none;
  result.compensated = kind;
  result.delay_s = delay_s;
  return result;
}

FrfEstimate as_measured(FrfEstimate frf) {
  if (frf.compensated == Compensation::none)
    throw std::invalid_argument("the response is not compensated; use it as it is");
  if (!(frf.sample_rate_hz > 0.0) || !std::isfinite(frf.sample_rate_hz))
    throw std::invalid_argument(
        "the sample rate is unknown, so the compensation cannot be undone; set sample_rate_hz");
  const double T = 1.0 / frf.sample_rate_hz;
  multiply(frf, [&](double omega) { return taken_out(frf.compensated, frf.delay_s, T, omega); });
  frf.hold = Hold::zoh;
  frf.compensated = Compensation::none;
  frf.delay_s = 0.0;
  return frf;
}

}  // namespace stageid
