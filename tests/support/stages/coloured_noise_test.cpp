#include "tests/support/stages/coloured_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace stageid::test_coloured_noise {

constexpr double kRateHz = 1000.0;

ColouredNoiseSpec spec_of(NoiseColour colour, double reference_hz) {
  return {.colour = colour,
          .channels = 1,
          .sample_rate_hz = kRateHz,
          .density = 4.0,
          .reference_hz = reference_hz,
          .damping_ratio = 0.05};
}

/// One-sided density at `hz`: mean of many periodograms of 1000 samples through a Hann window, whose power sums up to
/// 3/8 of the samples.
double density(ColouredNoise& noise, double hz) {
  constexpr int kSamples = 1000;
  constexpr int kPeriodograms = 2000;
  const double turn = 2.0 * std::numbers::pi / kSamples;
  std::vector<std::complex<double>> kernel(kSamples);
  for (int n = 0; n < kSamples; ++n)
    kernel[n] =
        0.5 * (1.0 - std::cos(turn * n)) * std::polar(1.0, -turn * n * hz * kSamples / kRateHz);
  double sum = 0.0;
  for (int i = 0; i < kPeriodograms; ++i) {
    std::complex<double> line = 0.0;
    for (const std::complex<double>& k : kernel) line += k * noise.next()[0];
    sum += std::norm(line);
  }
  return 2.0 * sum / kPeriodograms / (0.375 * kSamples * kRateHz);
}

// The standard deviation of a mean of 2000 periodograms is 2.2 %; the bounds are five of them.
constexpr double kBound = 0.12;
// |H(f0)|^2 / |H(2 f0)|^2 of a second-order system; the sampled one is close to it.
constexpr double kResonance = (9.0 + 16.0 * 0.0025) / (4.0 * 0.0025);

TEST(ColouredNoise, HasTheDensityOfItsColour) {
  struct Case {
    NoiseColour colour;
    double hz;
    double density;
    double bound;
  };
  for (const Case& c : {Case{NoiseColour::white, 20.0, 4.0, kBound},
                        {NoiseColour::white, 400.0, 4.0, kBound},
                        {NoiseColour::flicker, 50.0, 4.0, kBound + 0.03},
                        {NoiseColour::flicker, 10.0, 20.0, kBound + 0.03},
                        {NoiseColour::drift, 50.0, 4.0, kBound},
                        {NoiseColour::drift, 10.0, 100.0, kBound},
                        {NoiseColour::resonant, 50.0, 4.0, kBound},
                        {NoiseColour::resonant, 100.0, 4.0 / kResonance, 0.25}}) {
    ColouredNoise noise(spec_of(c.colour, 50.0));
    noise.restart(7, 1);
    EXPECT_NEAR(density(noise, c.hz) / c.density, 1.0, c.bound)
        << to_string(c.colour) << " at " << c.hz << " Hz";
  }
}

TEST(ColouredNoise, RepeatsFromItsSeed) {
  ColouredNoise a(spec_of(NoiseColour::flicker, 50.0));
  ColouredNoise b(spec_of(NoiseColour::flicker, 50.0));
  a.restart(3, 4);
  b.restart(3, 4);
  for (int n = 0; n < 100; ++n) ASSERT_EQ(a.next()[0], b.next()[0]);
  b.restart(3, 5);
  EXPECT_NE(a.next()[0], b.next()[0]);
}

TEST(ColouredNoise, RefusesAReferenceAboveHalfTheRate) {
  EXPECT_THROW(ColouredNoise(spec_of(NoiseColour::drift, 500.0)), std::invalid_argument);
}

}  // namespace stageid::test_coloured_noise
