#include "frf/response/hold_compensation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

namespace stageid::test_hold_compensation {

using Complex = std::complex<double>;
constexpr double kRate = 10000.0;
constexpr double T = 1.0 / kRate;

/// One input, one output, at 0.2, 1, 1.5, 2 kHz: `response(omega)` as a digital loop would measure it.
template <typename Response>
FrfEstimate sampled(const Response& response) {
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd{{200.0, 1000.0, 1500.0, 2000.0}};
  frf.inputs = {{"a"}, {"N"}};
  frf.outputs = {{"z"}, {"m"}};
  frf.sample_rate_hz = kRate;
  frf.hold = Hold::zoh;
  frf.response.resize(1, 4);
  for (Eigen::Index k = 0; k < 4; ++k) frf.response(0, k) = response(frf.omega_rad_s()[k]);
  frf.noise_variance = Eigen::MatrixXd::Constant(1, 4, 2.0);
  frf.total_variance = Eigen::MatrixXd::Constant(1, 4, 3.0);
  frf.residual_covariance = Eigen::MatrixXcd::Constant(1, 4, 5.0);
  frf.covariance = Eigen::MatrixXcd::Constant(1, 4, 2.0);
  return frf;
}

/// 1/s^2 behind a zero-order hold: T^2/2 (z + 1)/(z - 1)^2 (textbook), times the delay.
Complex double_integrator(double omega, double delay_s) {
  const Complex z = std::polar(1.0, omega * T);
  return 0.5 * T * T * (z + 1.0) / ((z - 1.0) * (z - 1.0)) * std::polar(1.0, -omega * delay_s);
}

/// 1/(s^2 + 2 zeta w s + w^2) behind a zero-order hold: the step-invariant transform.
Complex resonance(double omega, double w, double zeta) {
  const double wd = w * std::sqrt(1.0 - zeta * zeta);
  const double decay = std::exp(-zeta * w * T);
  const double c = std::cos(wd * T);
  const double s = zeta * w / wd * std::sin(wd * T);
  const double b1 = (1.0 - decay * (c + s)) / (w * w);
  const double b0 = (decay * decay + decay * (s - c)) / (w * w);
  const Complex z = std::polar(1.0, omega * T);
  return (b1 * z + b0) / (z * z - 2.0 * decay * c * z + decay * decay);
}

Complex continuous_resonance(double omega, double w, double zeta) {
  const Complex s(0.0, omega);
  return 1.0 / (s * s + 2.0 * zeta * w * s + w * w);
}

// Exact over compensated is cos(theta)/sinc^2 with the delay only, and 1.0000, .9993, .9965, .9882 with the hold: the
// rest is aliasing.
TEST(HoldCompensation, DoubleIntegratorBehindAZeroOrderHold) {
  constexpr double kDelay = 1.3 * T;
  const FrfEstimate frf = sampled([](double omega) { return double_integrator(omega, kDelay); });
  const FrfEstimate delay = compensate(frf, Compensation::delay, kDelay);
  const FrfEstimate hold = compensate(frf, Compensation::hold, kDelay);
  const std::array<double, 4> with_delay = {0.9993, 0.9830, 0.9600, 0.9244};
  const std::array<double, 4> with_hold = {1.0000, 0.9993, 0.9965, 0.9882};
  for (Eigen::Index k = 0; k < 4; ++k) {
    const double omega = frf.omega_rad_s()[k];
    const Complex truth = -1.0 / (omega * omega);
    const auto i = static_cast<std::size_t>(k);
    // Real ratios: no phase is left. 5e-5: the references have four digits.
    EXPECT_NEAR(std::abs(delay.response(0, k) / truth - with_delay[i]), 0.0, 6e-5) << k;
    EXPECT_NEAR(std::abs(hold.response(0, k) / truth - with_hold[i]), 0.0, 6e-5) << k;
    // The closed form of the first: cos(omega T / 2) / sinc^2.
    const double theta = 0.5 * omega * T;
    const double closed_form =
        std::cos(theta) * theta * theta / (std::sin(theta) * std::sin(theta));
    EXPECT_LT(std::abs(delay.response(0, k) / truth - closed_form), 1e-9);
  }
}

TEST(HoldCompensation, ResonanceBehindAZeroOrderHold) {
  const double w = 2.0 * std::numbers::pi * 1900.0;
  constexpr double kDamping = 0.005;
  FrfEstimate frf = sampled([&](double omega) { return resonance(omega, w, kDamping); });
  frf.frequency_hz[3] = 1900.0;
  frf.response(0, 3) = resonance(w, w, kDamping);
  const Complex truth = continuous_resonance(w, w, kDamping);
  const Complex delay = compensate(frf, Compensation::delay, 0.0).response(0, 3);
  const Complex hold = compensate(frf, Compensation::hold, 0.0).response(0, 3);
  // At the peak, aliasing is negligible; compensating the delay alone leaves the sinc: 5.8 %.
  EXPECT_NEAR(std::abs(delay / truth), 0.942, 1e-3);
  EXPECT_LT(std::abs(hold / truth - 1.0), 2e-3);
}

TEST(HoldCompensation, VariancesFollowTheMagnitude) {
  const FrfEstimate frf = sampled([](double omega) { return double_integrator(omega, 0.0); });
  const FrfEstimate delay = compensate(frf, Compensation::delay, 1e-3);
  const FrfEstimate hold = compensate(frf, Compensation::hold, 1e-3);
  for (Eigen::Index k = 0; k < 4; ++k) {
    EXPECT_NEAR(delay.noise_variance(0, k), 2.0, 1e-14);
    EXPECT_NEAR(delay.total_variance(0, k), 3.0, 1e-14);
    const double power = std::norm(hold.response(0, k)) / std::norm(frf.response(0, k));
    EXPECT_GT(power, 1.0);
    EXPECT_NEAR(hold.noise_variance(0, k), 2.0 * power, 1e-12);
    EXPECT_NEAR(hold.total_variance(0, k), 3.0 * power, 1e-12);
    EXPECT_NEAR(hold.residual_covariance(0, k).real(), 5.0 * power, 1e-12);
    EXPECT_NEAR(hold.covariance(0, k).real(), 2.0 * power, 1e-12);
  }
}

TEST(HoldCompensation, SaysWhatItDid) {
  const FrfEstimate frf = sampled([](double) { return Complex(1.0, 0.0); });
  const FrfEstimate delay = compensate(frf, Compensation::delay, 2e-4);
  EXPECT_EQ(delay.compensated, Compensation::delay);
  EXPECT_EQ(delay.delay_s, 2e-4);
  EXPECT_EQ(delay.hold, Hold::zoh);  // the sinc remains
  const FrfEstimate hold = compensate(frf, Compensation::hold, 2e-4);
  EXPECT_EQ(hold.compensated, Compensation::hold);
  EXPECT_EQ(hold.hold, Hold::none);
  const FrfEstimate none = compensate(frf, Compensation::none, 2e-4);
  EXPECT_EQ(none.response, frf.response);
  EXPECT_EQ(none.compensated, Compensation::none);
}

TEST(HoldCompensation, ALineAtZeroStaysFinite) {
  FrfEstimate frf = sampled([](double) { return Complex(1.0, 0.0); });
  frf.frequency_hz[0] = 0.0;
  EXPECT_LT(std::abs(compensate(frf, Compensation::hold, 1e-4).response(0, 0) - 1.0), 1e-15);
}

TEST(AsMeasured, PutsBackWhatWasTakenOut) {
  const FrfEstimate frf = sampled([](double omega) { return double_integrator(omega, 1e-4); });
  for (const Compensation kind : {Compensation::delay, Compensation::hold}) {
    const FrfEstimate back = as_measured(compensate(frf, kind, 3.7e-4));
    // Compensated and restored: only rounding remains.
    EXPECT_LT((back.response - frf.response).norm(), 1e-14 * frf.response.norm());
    EXPECT_LT((back.noise_variance - frf.noise_variance).norm(), 1e-13);
    EXPECT_LT((back.total_variance - frf.total_variance).norm(), 1e-13);
    EXPECT_EQ(back.hold, Hold::zoh);
    EXPECT_EQ(back.compensated, Compensation::none);
    EXPECT_EQ(back.delay_s, 0.0);
  }
}

TEST(HoldCompensation, Errors) {
  const FrfEstimate frf = sampled([](double) { return Complex(1.0, 0.0); });
  EXPECT_THROW(as_measured(frf), std::invalid_argument);
  EXPECT_THROW(compensate(frf, Compensation::hold, std::nan("")), std::invalid_argument);
  FrfEstimate delayed = compensate(frf, Compensation::delay, 0.0);
  EXPECT_THROW(compensate(delayed, Compensation::hold, 0.0), std::invalid_argument);
  delayed.sample_rate_hz = 0.0;
  EXPECT_THROW(as_measured(delayed), std::invalid_argument);
  FrfEstimate unknown_rate = frf;
  unknown_rate.sample_rate_hz = 0.0;
  EXPECT_THROW(compensate(unknown_rate, Compensation::delay, 0.0), std::invalid_argument);
  FrfEstimate no_hold = frf;
  no_hold.hold = Hold::none;
  EXPECT_THROW(compensate(no_hold, Compensation::hold, 0.0), std::invalid_argument);
}

}  // namespace stageid::test_hold_compensation
