// Frequency responses in closed form, by partial fractions over the poles. They share no code with the
// simulator, which uses transitions in the time domain.
//
// One mode, 1 / ((s - p)(s - p*)), is the divided difference over p and p* of 1 / (s - p). Through
// a hold delayed by (d + e) samples, 0 <= e < 1, and a sampler, 1 / (s - p) becomes
//   z^-d [ f((1-e) T) + e^(p (1-e) T) f(e T) z^-1 ] / (z - e^(p T)),   f(t) = (e^(p t) - 1) / p.
#include <cmath>
#include <complex>

#include "excitation/words/require.hpp"
#include "hal/simulator/mode_transition.hpp"
#include "hal/simulator/plant_spec.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

// e^z - 1 without cancellation for small z: e^x cos y - 1 = expm1(x) cos y - 2 sin^2(y/2).
Complex expm1(Complex z) {
  const double half_sine = std::sin(0.5 * z.imag());
  return {std::expm1(z.real()) * std::cos(z.imag()) - 2.0 * half_sine * half_sine,
          std::exp(z.real()) * std::sin(z.imag())};
}

struct Sampling {
  double period_s;
  double omega_rad_s;
  double fraction;    // e
  Complex z_inverse;  // e^(-j omega T)
  Complex z_delay;    // z^-d
};

Sampling sampling(double delay_s, double sample_rate_hz, double frequency_hz) {
  const double whole = std::floor(delay_s * sample_rate_hz);
  const double turns = frequency_hz / sample_rate_hz;
  return {1.0 / sample_rate_hz, kTwoPi * frequency_hz, delay_s * sample_rate_hz - whole,
          std::polar(1.0, -kTwoPi * turns), std::polar(1.0, -kTwoPi * turns * whole)};
}

// 1 / (s - p), sampled. z - e^(pT) = e^(pT) (e^((j omega - p) T) - 1) remains accurate near the pole.
Complex sampled_first_order(Complex pole, const Sampling& at) {
  const double late = (1.0 - at.fraction) * at.period_s;
  const double early = at.fraction * at.period_s;
  const Complex numerator =
      (expm1(pole * late) + std::exp(pole * late) * expm1(pole * early) * at.z_inverse) / pole;
  const Complex j_omega(0.0, at.omega_rad_s);
  const Complex denominator = std::exp(pole * at.period_s) * expm1((j_omega - pole) * at.period_s);
  return at.z_delay * numerator / denominator;
}

// 1 / s^2, sampled: position and velocity of a free mass under two held forces per interval.
Complex sampled_double_integrator(const Sampling& at) {
  const double late = (1.0 - at.fraction) * at.period_s;
  const double early = at.fraction * at.period_s;
  const Complex position = 0.5 * late * late + (early * late + 0.5 * early * early) * at.z_inverse;
  const Complex velocity = late + early * at.z_inverse;
  const Complex z_minus_1 = expm1(Complex(0.0, at.omega_rad_s * at.period_s));
  return at.z_delay * (position + at.period_s * velocity / z_minus_1) / z_minus_1;
}

/// Position and acceleration of a mode.
struct ModalResponse {
  Complex position;
  Complex acceleration;
};

/// By q'' = f - 2 zeta omega q' - omega^2 q, with the force just before the sample.
ModalResponse sampled_mode(const PlantMode& mode, const Sampling& at) {
  const Complex force = at.z_delay * at.z_inverse;
  if (mode.natural_frequency_hz == 0.0) return {sampled_double_integrator(at), force};
  const double omega = kTwoPi * mode.natural_frequency_hz;
  const double zeta = mode.damping_ratio;
  const Complex pole(-zeta * omega, omega * std::sqrt(1.0 - zeta * zeta));
  const Complex one = sampled_first_order(pole, at);
  const Complex other = sampled_first_order(std::conj(pole), at);
  const Complex span(0.0, 2.0 * pole.imag());
  const Complex position = (one - other) / span;
  const Complex speed = (pole * one - std::conj(pole) * other) / span;
  return {position, force - 2.0 * zeta * omega * speed - omega * omega * position};
}

}  // namespace

Eigen::MatrixXcd sampled_response(const std::vector<PlantMode>& modes, double delay_s,
                                  double sample_rate_hz, double frequency_hz) {
  require(sample_rate_hz > 0.0 && delay_s >= 0.0,
          "plant response: the sample rate must be positive and the delay 0 or more; got {} Hz and "
          "{} s",
          sample_rate_hz, delay_s);
  const Sampling at = sampling(delay_s, sample_rate_hz, frequency_hz);
  require(!modes.empty(), "plant response: at least one mode is needed");
  Eigen::MatrixXcd sum =
      Eigen::MatrixXcd::Zero(modes[0].sensor_shape.size(), modes[0].actuator_shape.size());
  for (const PlantMode& mode : modes) {
    require(mode.damping_ratio >= 0.0 && mode.damping_ratio < 1.0,
            "plant response: damping_ratio must be in [0, 1); got {}", mode.damping_ratio);
    const ModalResponse of_mode = sampled_mode(mode, at);
    sum += of_mode.position * (mode.sensor_shape * mode.actuator_shape.transpose());
    if (mode.acceleration_shape.size() > 0)
      sum += of_mode.acceleration * (mode.acceleration_shape * mode.actuator_shape.transpose());
  }
  return sum;
}

}  // namespace stageid
