#include "estimation/start/stabilization.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>

namespace stageid::test_stabilization {

using Complex = std::complex<double>;
constexpr double pi = std::numbers::pi;

struct KnownPole {
  double frequency_hz;
  double damping_ratio;
};

/// A response of 2 x 1 channels on 400 lines to 500 Hz; element(channel, s) gives it at s = j omega.
template <typename Element>
FrfEstimate response_of(Element element) {
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(400, 1.25, 500.0);
  frf.inputs = {.names = {"u"}, .units = {"N"}};
  frf.outputs = {.names = {"a", "b"}, .units = {"m", "m"}};
  frf.response.resize(2, 400);
  for (Eigen::Index k = 0; k < 400; ++k)
    for (int c = 0; c < 2; ++c)
      frf.response(c, k) = element(c, Complex(0.0, 2.0 * pi * frf.frequency_hz[k]));
  return frf;
}

Complex pole_of(const KnownPole& known) {
  const double omega = 2.0 * pi * known.frequency_hz;
  return omega * Complex(-known.damping_ratio, std::sqrt(1.0 - std::pow(known.damping_ratio, 2)));
}

const std::vector<KnownPole> kKnown = {{60.0, 0.02}, {64.0, 0.01}, {310.0, 0.004}};

/// Modes and the double integrator of a rigid body, as in a stage; not a rational function of z.
Complex stage(int channel, Complex s) {
  Complex sum = 1.0 / (s * s);
  for (std::size_t i = 0; i < kKnown.size(); ++i) {
    const double omega = 2.0 * pi * kKnown[i].frequency_hz;
    const double sign = channel == 1 && i % 2 == 1 ? -1.0 : 1.0;
    sum += sign / (s * s + 2.0 * kKnown[i].damping_ratio * omega * s + omega * omega);
  }
  return sum;
}

std::vector<StabilizationPole> at_order(const std::vector<StabilizationPole>& poles, int order) {
  std::vector<StabilizationPole> out;
  for (const StabilizationPole& pole : poles)
    if (pole.order == order) out.push_back(pole);
  return out;
}

TEST(Stabilization, FindsThePolesOfARationalFunctionOfZExactly) {
  const double T = 0.5 / 500.0;
  const FrfEstimate frf = response_of([&](int channel, Complex s) {
    Complex sum = 0.0;
    for (std::size_t i = 0; i < 2; ++i) {
      const Complex p = std::exp(pole_of(kKnown[2 * i]) * T);
      const Complex residue(1.0 + channel, 0.3 * static_cast<double>(i));
      sum += residue / (1.0 - p * std::exp(-s * T)) +
             std::conj(residue) / (1.0 - std::conj(p) * std::exp(-s * T));
    }
    return sum;
  });
  const auto four = at_order(stabilization(frf, {.most_order = 4}), 4);
  ASSERT_EQ(four.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    // Normal equations of condition up to 1e12: half the digits, and some to spare.
    EXPECT_NEAR(four[i].frequency_hz / kKnown[2 * i].frequency_hz, 1.0, 1e-6);
    EXPECT_NEAR(four[i].damping_ratio / kKnown[2 * i].damping_ratio, 1.0, 1e-4);
  }
}

TEST(Stabilization, ShowsTheModesOfAStageAndNothingElseAtTheLargestOrder) {
  const auto poles = stabilization(response_of(stage), {.most_order = 40});
  const auto last = at_order(poles, 40);
  ASSERT_EQ(last.size(), kKnown.size());
  for (std::size_t i = 0; i < last.size(); ++i) {
    EXPECT_NEAR(last[i].frequency_hz / kKnown[i].frequency_hz, 1.0, 1e-3);
    EXPECT_NEAR(last[i].damping_ratio / kKnown[i].damping_ratio, 1.0, 0.05);
    EXPECT_TRUE(last[i].stable_frequency && last[i].stable_damping);
  }
  for (const StabilizationPole& pole : poles) {
    EXPECT_EQ(pole.order % 2, 0);
    EXPECT_TRUE(pole.stable_frequency || !pole.stable_damping);
    EXPECT_GT(pole.damping_ratio, 0.0);
    EXPECT_LE(pole.damping_ratio, 0.2);
  }
  for (const StabilizationPole& pole : at_order(poles, 2)) EXPECT_FALSE(pole.stable_frequency);
}

TEST(Stabilization, TakesADelayOutFirst) {
  const double delay_s = 1.7e-3;
  const auto plain = stabilization(response_of(stage), {.most_order = 20});
  const auto delayed = stabilization(response_of([&](int channel, Complex s) {
                                       return stage(channel, s) * std::exp(-s * delay_s);
                                     }),
                                     {.most_order = 20, .delay_s = delay_s});
  const auto want = at_order(plain, 20);
  const auto got = at_order(delayed, 20);
  ASSERT_EQ(got.size(), want.size());
  for (std::size_t i = 0; i < got.size(); ++i)
    EXPECT_NEAR(got[i].frequency_hz / want[i].frequency_hz, 1.0, 1e-5);
}

TEST(Stabilization, RefusesOrdersThatTheLinesDoNotCarry) {
  const FrfEstimate frf = response_of(stage);
  EXPECT_THROW(stabilization(frf, {.most_order = 1}), std::invalid_argument);
  EXPECT_THROW(stabilization(frf, {.most_order = 200}), std::invalid_argument);
  EXPECT_NO_THROW(stabilization(frf, {.most_order = 198}));
}

}  // namespace stageid::test_stabilization
