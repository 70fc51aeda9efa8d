#include "tests/support/stages/coloured_noise.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>

namespace stageid {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kLowestCorner = 1e-5;  // of flicker noise, relative to the sample rate

Eigen::Index states_of(const ColouredNoiseSpec& spec) {
  switch (spec.colour) {
    case NoiseColour::white:
    case NoiseColour::drift:
      return 1;
    case NoiseColour::resonant:
      return 2;
    case NoiseColour::flicker:
      break;
  }
  return static_cast<Eigen::Index>(std::ceil(std::log2(0.25 / kLowestCorner)));
}

}  // namespace

ColouredNoise::ColouredNoise(const ColouredNoiseSpec& spec) : spec_(spec) {
  const double rate = spec.sample_rate_hz;
  if (!(rate > 0.0) || !(spec.reference_hz > 0.0) || !(2.0 * spec.reference_hz < rate) ||
      !(spec.density >= 0.0) || !(spec.damping_ratio > 0.0 && spec.damping_ratio < 1.0))
    throw std::invalid_argument(
        "coloured noise: the sample rate must be positive, the reference below half of it, the "
        "density 0 or more and the damping ratio between 0 and 1");
  const Eigen::Index states = states_of(spec);
  constexpr auto kBlock = static_cast<Eigen::Index>(NormalSource::kBlock);
  const Eigen::Index count = spec.channels * std::max<Eigen::Index>(states, 1);
  numbers_.setZero((count + kBlock - 1) / kBlock * kBlock);
  state_.setZero(spec.channels, states);
  value_.setZero(spec.channels);
  drive_.setZero(states);
  const double omega = 2.0 * kPi * spec.reference_hz / rate;
  switch (spec.colour) {
    case NoiseColour::white:
      drive_.setConstant(std::sqrt(0.5 * spec.density * rate));
      break;
    case NoiseColour::drift:  // 2 s^2 / (rate |1 - exp(-j omega)|^2)
      drive_.setConstant(std::sqrt(0.5 * spec.density * rate) * 2.0 * std::sin(0.5 * omega));
      break;
    case NoiseColour::flicker: {
      // Low passes one octave apart, each of variance v, sum to the one-sided density v / (f ln 2).
      const double deviation = std::sqrt(spec.density * spec.reference_hz * std::numbers::ln2);
      pole_.resize(states);
      for (Eigen::Index i = 0; i < states; ++i)
        pole_[i] = std::exp(-2.0 * kPi * kLowestCorner * std::exp2(static_cast<double>(i)));
      drive_ = deviation * (1.0 - pole_.square()).sqrt();
      break;
    }
    case NoiseColour::resonant: {
      radius_ = std::exp(-spec.damping_ratio * omega);
      const double angle = omega * std::sqrt(1.0 - spec.damping_ratio * spec.damping_ratio);
      turn_ = 2.0 * radius_ * std::cos(angle);
      const std::complex<double> z = std::polar(1.0, -omega);
      drive_[0] = std::sqrt(0.5 * spec.density * rate) *
                  std::abs(1.0 - turn_ * z + radius_ * radius_ * z * z);
      break;
    }
  }
}

void ColouredNoise::draw() noexcept {
  source_.fill(numbers_.data(), static_cast<std::size_t>(numbers_.size()) / NormalSource::kBlock);
}

void ColouredNoise::restart(std::uint64_t seed, std::uint64_t stream) noexcept {
  source_ = NormalSource(seed, stream);
  state_.setZero();
  value_.setZero();
  if (spec_.colour == NoiseColour::flicker) {
    draw();
    for (Eigen::Index i = 0; i < state_.cols(); ++i)
      state_.col(i) = numbers_.segment(i * spec_.channels, spec_.channels) * drive_[i] /
                      std::sqrt(1.0 - pole_[i] * pole_[i]);
  }
  if (spec_.colour == NoiseColour::resonant) {
    // After ten time constants, the initial state is negligible.
    const auto samples = static_cast<int>(std::min(10.0 / (1.0 - radius_), 1e6));
    for (int n = 0; n < samples; ++n) next();
  }
}

const Eigen::ArrayXd& ColouredNoise::next() noexcept {
  if (spec_.density == 0.0) return value_;
  draw();
  const Eigen::Index n = spec_.channels;
  switch (spec_.colour) {
    case NoiseColour::white:
      value_ = drive_[0] * numbers_.head(n);
      break;
    case NoiseColour::drift:
      value_ += drive_[0] * numbers_.head(n);
      break;
    case NoiseColour::flicker:
      value_.setZero();
      for (Eigen::Index i = 0; i < state_.cols(); ++i) {
        state_.col(i) = pole_[i] * state_.col(i) + drive_[i] * numbers_.segment(i * n, n);
        value_ += state_.col(i);
      }
      break;
    case NoiseColour::resonant:
      value_ =
          turn_ * state_.col(0) - radius_ * radius_ * state_.col(1) + drive_[0] * numbers_.head(n);
      state_.col(1) = state_.col(0);
      state_.col(0) = value_;
      break;
  }
  return value_;
}

}  // namespace stageid
