#include "hal/simulator/noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace stageid::test_noise {

std::vector<double> numbers(std::uint64_t seed, std::uint64_t stream, std::size_t blocks) {
  NormalSource source(seed, stream);
  std::vector<double> values(blocks * NormalSource::kBlock);
  source.fill(values.data(), blocks);
  return values;
}

double moment(const std::vector<double>& values, int power) {
  double sum = 0.0;
  for (const double v : values) sum += std::pow(v, power);
  return sum / static_cast<double>(values.size());
}

// Bounds of five standard deviations of the estimate itself: var(x^p) = m_2p - m_p^2 with the
// normal moments 1, 3, 15, 105, 945, 10395, 135135 of order 2, 4, ... 14.
TEST(NormalSource, HasTheMomentsOfTheNormalDistribution) {
  const auto values = numbers(11, 3, 65536);
  const double root = std::sqrt(static_cast<double>(values.size()));
  EXPECT_NEAR(moment(values, 1), 0.0, 5.0 * 1.0 / root);
  EXPECT_NEAR(moment(values, 2), 1.0, 5.0 * std::sqrt(3.0 - 1.0) / root);
  EXPECT_NEAR(moment(values, 3), 0.0, 5.0 * std::sqrt(15.0) / root);
  EXPECT_NEAR(moment(values, 4), 3.0, 5.0 * std::sqrt(105.0 - 9.0) / root);
  EXPECT_NEAR(moment(values, 6), 15.0, 5.0 * std::sqrt(10395.0 - 225.0) / root);
}

// Kolmogorov-Smirnov against the error function: P(sqrt(n) D > 2.2) = 2 exp(-2 * 2.2^2) = 1.2e-4.
TEST(NormalSource, HasTheNormalDistributionFunction) {
  auto values = numbers(5, 0, 16384);
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  double distance = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double expected = 0.5 * std::erfc(-values[i] / std::numbers::sqrt2);
    distance = std::max(distance, std::abs(expected - static_cast<double>(i) / n));
  }
  EXPECT_LT(distance * std::sqrt(n), 2.2);
}

TEST(NormalSource, IsWhite) {
  const auto values = numbers(2, 9, 16384);
  const std::size_t n = values.size() - 100;
  for (const std::size_t lag : {1U, 2U, 7U, 8U, 16U, 32U, 64U, 96U}) {
    double sum = 0.0;
    double squares = 0.0;  // Box-Muller pairs have a common radius, so the squares are tested too
    for (std::size_t i = 0; i < n; ++i) {
      sum += values[i] * values[i + lag];
      squares += (values[i] * values[i] - 1.0) * (values[i + lag] * values[i + lag] - 1.0);
    }
    const double root = std::sqrt(static_cast<double>(n));
    EXPECT_LT(std::abs(sum / root), 5.0) << "lag " << lag;
    EXPECT_LT(std::abs(squares / (2.0 * root)), 5.0) << "lag " << lag;
  }
}

TEST(NormalSource, IsRepeatableAndItsStreamsAreNot) {
  EXPECT_EQ(numbers(1, 2, 8), numbers(1, 2, 8));
  EXPECT_NE(numbers(1, 2, 8), numbers(2, 1, 8));
  EXPECT_NE(numbers(1, 2, 8), numbers(1, 3, 8));
  const auto a = numbers(1, 2, 16384);
  const auto b = numbers(1, 3, 16384);
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  EXPECT_LT(std::abs(sum) / std::sqrt(static_cast<double>(a.size())), 5.0);
}

TEST(StageNoise, HasTheAskedRmsAndSpectrum) {
  const NoiseSpec spec{3, 2, 1000.0, 0.5, 2e-9, 4e-9, 30.0};
  StageNoise noise(spec);
  noise.restart(7, 7);
  constexpr int kSamples = 1 << 18;
  double force = 0.0;
  double sensor = 0.0;
  std::vector<double> y;
  for (int n = 0; n < kSamples; ++n) {
    noise.next();
    force += noise.force_n()[1] * noise.force_n()[1];
    sensor += noise.sensor_m()[0] * noise.sensor_m()[0];
    y.push_back(noise.sensor_m()[1]);
  }
  const double n = kSamples;
  EXPECT_NEAR(std::sqrt(force / n), 0.5, 5.0 * 0.5 / std::sqrt(2.0 * n));
  // The coloured part has a correlation time of 1 / (2 pi 30 Hz) = 5.3 samples; n / 11 are
  // independent.
  const double rms = std::hypot(2e-9, 4e-9);
  EXPECT_NEAR(std::sqrt(sensor / n), rms, 5.0 * rms / std::sqrt(2.0 * n / 11.0));
  // Autocovariance of white plus first-order noise: c^2 a^k beyond lag 0.
  const double a = std::exp(-2.0 * std::numbers::pi * 30.0 / 1000.0);
  for (const int lag : {1, 5, 20}) {
    double sum = 0.0;
    for (std::size_t i = 0; i + 20 < y.size(); ++i)
      sum += y[i] * y[i + static_cast<std::size_t>(lag)];
    EXPECT_NEAR(sum / n, 16e-18 * std::pow(a, lag), 5.0 * rms * rms / std::sqrt(n / 11.0)) << lag;
  }
}

// 4000 first samples of as many runs: the coloured part must not start at zero.
TEST(StageNoise, StartsStationary) {
  StageNoise noise({0, 1, 1e4, 0.0, 0.0, 1e-9, 1.0});
  double sum = 0.0;
  constexpr int kRuns = 4000;
  for (int run = 0; run < kRuns; ++run) {
    noise.restart(1, static_cast<std::uint64_t>(run));
    noise.next();
    sum += std::pow(noise.sensor_m()[0] / 1e-9, 2);
  }
  EXPECT_NEAR(sum / kRuns, 1.0, 5.0 * std::sqrt(2.0 / kRuns));
}

TEST(StageNoise, OfOneKindDoesNotDependOnAnother) {
  StageNoise all({3, 2, 1e4, 1.0, 1.0, 1.0, 10.0});
  StageNoise force_only({3, 2, 1e4, 1.0, 0.0, 0.0, 10.0});
  all.restart(4, 4);
  force_only.restart(4, 4);
  for (int n = 0; n < 100; ++n) {
    all.next();
    force_only.next();
    for (int i = 0; i < 3; ++i) EXPECT_EQ(all.force_n()[i], force_only.force_n()[i]);
  }
}

TEST(StageNoise, CanBeSilent) {
  StageNoise noise({3, 2, 1e4, 0.0, 0.0, 0.0, 10.0});
  noise.restart(1, 1);
  noise.next();
  EXPECT_EQ(noise.force_n()[2], 0.0);
  EXPECT_EQ(noise.sensor_m()[1], 0.0);
}

}  // namespace stageid::test_noise
