#include "hal/simulator/noise.hpp"

#include <bit>
#include <cmath>
#include <numbers>

namespace stageid {
namespace {

constexpr std::size_t kRows = 16;  // samples drawn at a time

std::uint64_t split_mix(std::uint64_t& state) noexcept {
  std::uint64_t z = (state += 0x9e3779b97f4a7c15);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return z ^ (z >> 31);
}

// 52 random bits as a double in [1, 2).
inline double one_to_two(std::uint64_t bits) noexcept {
  return std::bit_cast<double>((bits >> 12) | 0x3ff0000000000000);
}

// ln x for normal positive x: x = 2^k m with m in [1/sqrt 2, sqrt 2), and
// ln m = 2 artanh(s) = 2 (s + s^3/3 + ...), s = (m - 1)/(m + 1), |s| < 0.172: rounding after s^19.
inline double logarithm(double x) noexcept {
  constexpr std::uint64_t kSqrtHalf = 0x3fe6a09e667f3bcd;
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x);
  const std::uint64_t shifted = bits - kSqrtHalf;  // its exponent field is k, in two's complement
  // k + 1024 >= 0 becomes a double when placed in the low bits of 2^52.
  const std::uint64_t biased = (shifted + (std::uint64_t{1024} << 52)) >> 52;
  const double k = std::bit_cast<double>(biased | 0x4330000000000000) - (0x1p52 + 1024.0);
  const double m = std::bit_cast<double>(bits - ((biased - 1024) << 52));
  const double s = (m - 1.0) / (m + 1.0);
  const double t = s * s;
  double p = 1.0 / 19.0;
  p = p * t + 1.0 / 17.0;
  p = p * t + 1.0 / 15.0;
  p = p * t + 1.0 / 13.0;
  p = p * t + 1.0 / 11.0;
  p = p * t + 1.0 / 9.0;
  p = p * t + 1.0 / 7.0;
  p = p * t + 1.0 / 5.0;
  p = p * t + 1.0 / 3.0;
  p = p * t + 1.0;
  return k * std::numbers::ln2 + 2.0 * s * p;
}

// Taylor series on a quarter of the angle, |x| <= pi/4, then doubled twice.
inline void sine_cosine(double turns, double& sine, double& cosine) noexcept {
  const double x = 0.5 * std::numbers::pi * turns;  // turns in [-1/2, 1/2)
  const double t = x * x;
  double s = 1.0 / 1307674368000.0 * -1.0;  // 15!
  s = s * t + 1.0 / 6227020800.0;
  s = s * t - 1.0 / 39916800.0;
  s = s * t + 1.0 / 362880.0;
  s = s * t - 1.0 / 5040.0;
  s = s * t + 1.0 / 120.0;
  s = s * t - 1.0 / 6.0;
  s = (s * t + 1.0) * x;
  double c = 1.0 / 20922789888000.0;  // 16!
  c = c * t - 1.0 / 87178291200.0;
  c = c * t + 1.0 / 479001600.0;
  c = c * t - 1.0 / 3628800.0;
  c = c * t + 1.0 / 40320.0;
  c = c * t - 1.0 / 720.0;
  c = c * t + 1.0 / 24.0;
  c = c * t - 0.5;
  c = c * t + 1.0;
  for (int i = 0; i < 2; ++i) {
    const double s2 = 2.0 * s * c;
    c = 1.0 - 2.0 * s * s;
    s = s2;
  }
  sine = s;
  cosine = c;
}

}  // namespace

NormalSource::NormalSource(std::uint64_t seed, std::uint64_t stream) noexcept {
  // Hashing the stream first gives unrelated sequences for (seed, stream), (stream, seed) and neighbours.
  std::uint64_t mixed = stream;
  std::uint64_t state = seed ^ split_mix(mixed);
  for (auto& word : state_)
    for (auto& lane : word) lane = split_mix(state);
}

void NormalSource::next_bits(std::uint64_t* out) noexcept {
  auto& [s0, s1, s2, s3] = state_;
  for (std::size_t i = 0; i < kLanes; ++i) {
    out[i] = std::rotl(s0[i] + s3[i], 23) + s0[i];
    const std::uint64_t t = s1[i] << 17;
    s2[i] ^= s0[i];
    s3[i] ^= s1[i];
    s1[i] ^= s2[i];
    s0[i] ^= s3[i];
    s2[i] ^= t;
    s3[i] = std::rotl(s3[i], 45);
  }
}

void NormalSource::fill(double* __restrict__ out, std::size_t blocks) noexcept {
  for (std::size_t block = 0; block < blocks; ++block, out += kBlock) {
    std::uint64_t radius_bits[kLanes];
    std::uint64_t angle_bits[kLanes];
    next_bits(radius_bits);
    next_bits(angle_bits);
    for (std::size_t i = 0; i < kLanes; ++i) {
      const double uniform = 2.0 - one_to_two(radius_bits[i]);  // (0, 1]
      const double radius = std::sqrt(-2.0 * logarithm(uniform));
      double sine = 0.0;
      double cosine = 0.0;
      sine_cosine(one_to_two(angle_bits[i]) - 1.5, sine, cosine);
      out[i] = radius * cosine;
      out[kLanes + i] = radius * sine;
    }
  }
}

StageNoise::StageNoise(const NoiseSpec& spec) : spec_(spec) {
  silent_ = spec.force_n == 0.0 && spec.sensor_m == 0.0 && spec.sensor_coloured_m == 0.0;
  pole_ = std::exp(-2.0 * std::numbers::pi * spec.sensor_corner_hz / spec.sample_rate_hz);
  drive_m_ = spec.sensor_coloured_m * std::sqrt((1.0 - pole_) * (1.0 + pole_));
  const auto count = static_cast<std::size_t>(spec.actuators + 2 * spec.sensors);
  constexpr std::size_t kBlock = NormalSource::kBlock;
  stride_ = (count + kBlock - 1) / kBlock * kBlock;
  numbers_.setZero(static_cast<Eigen::Index>(stride_ * kRows));
  force_.setZero(spec.actuators);
  coloured_.setZero(spec.sensors);
  sensor_.setZero(spec.sensors);
}

void StageNoise::restart(std::uint64_t seed, std::uint64_t stream) noexcept {
  source_ = NormalSource(seed, stream);
  next_row_ = kRows;
  force_.setZero();
  sensor_.setZero();
  if (silent_) return;
  const double* number = row();
  for (Eigen::Index i = 0; i < spec_.sensors; ++i)
    coloured_[i] = spec_.sensor_coloured_m * number[spec_.actuators + spec_.sensors + i];
}

const double* StageNoise::row() noexcept {
  if (next_row_ == kRows) {
    source_.fill(numbers_.data(), stride_ * kRows / NormalSource::kBlock);
    next_row_ = 0;
  }
  return numbers_.data() + stride_ * next_row_++;
}

void StageNoise::next() noexcept {
  if (silent_) return;
  const double* force = row();
  const double* white = force + spec_.actuators;
  const double* drive = white + spec_.sensors;
  for (Eigen::Index i = 0; i < spec_.actuators; ++i) force_[i] = spec_.force_n * force[i];
  for (Eigen::Index i = 0; i < spec_.sensors; ++i) {
    coloured_[i] = pole_ * coloured_[i] + drive_m_ * drive[i];
    sensor_[i] = spec_.sensor_m * white[i] + coloured_[i];
  }
}

}  // namespace stageid
