#include "frf/period_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "frf/plant_frf.hpp"
#include "tests/support/sampled_loop.hpp"

namespace stageid {
namespace {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;

constexpr Eigen::Index kLines = 64;
constexpr Eigen::Index kChannels = 3;

Eigen::VectorXd frequencies() { return Eigen::VectorXd::LinSpaced(kLines, 1.0, 64.0); }

/// The same spectrum with noise of another colour and strength in each channel.
std::vector<Eigen::MatrixXcd> clean_periods(int count, std::uint64_t seed) {
  test::ComplexNoise random(seed);
  std::vector<Eigen::MatrixXcd> periods(static_cast<std::size_t>(count),
                                        Eigen::MatrixXcd(kChannels, kLines));
  for (Eigen::MatrixXcd& period : periods)
    for (Eigen::Index k = 0; k < kLines; ++k)
      for (Eigen::Index c = 0; c < kChannels; ++c)
        period(c, k) = std::complex<double>(1.0, static_cast<double>(c)) +
                       std::pow(10.0, -static_cast<double>(c)) / static_cast<double>(k + 1) *
                           random.gaussian();
  return periods;
}

TEST(PeriodCheck, CleanPeriodsStay) {
  constexpr int kRuns = 2000;
  for (const int count : {3, 5, 10}) {
    int spoilt = 0;
    for (int run = 1; run <= kRuns; ++run) {
      const auto periods = clean_periods(count, static_cast<std::uint64_t>(run));
      spoilt += find_outliers(periods, frequencies()).empty() ? 0 : 1;
    }
    // kDropByChance bounds the mean by 2: more than 9 has a probability of 5e-5.
    EXPECT_LE(spoilt, 9) << count << " periods";
  }
}

/// Noise that is white or drifts slowly, cut into periods.
std::vector<Eigen::MatrixXcd> drifting_periods(int count, double drift, std::uint64_t seed) {
  constexpr int kSamples = 256;
  test::ComplexNoise random(seed);
  std::vector<Eigen::MatrixXcd> periods;
  double force = 0.0;
  double slow = 0.0;
  for (int p = 0; p < count; ++p) {
    Eigen::MatrixXcd period = Eigen::MatrixXcd::Zero(1, 100);
    for (int n = 0; n < kSamples; ++n) {
      force = 0.95 * force + drift * random.gaussian().real();
      slow = 0.95 * slow + force;
      const double x = slow + random.gaussian().real();
      for (Eigen::Index k = 0; k < period.cols(); ++k)
        period(0, k) += x * std::polar(1.0, -2.0 * std::numbers::pi * n *
                                                static_cast<double>(k + 1) / kSamples);
    }
    periods.push_back(std::move(period));
  }
  return periods;
}

// What a slow disturbance is at the ends of a period leaks into all lines together.
TEST(PeriodCheck, SlowDisturbancesThatLeakAreNoReason) {
  constexpr int kRuns = 300;
  const Eigen::VectorXd frequency_hz = Eigen::VectorXd::LinSpaced(100, 1.0, 100.0);
  int spoilt = 0;
  for (int run = 1; run <= kRuns; ++run)
    spoilt += find_outliers(drifting_periods(4, 1.0, static_cast<std::uint64_t>(run)), frequency_hz)
                      .empty()
                  ? 0
                  : 1;
  EXPECT_LE(spoilt, 4);  // kDropByChance bounds the mean by 0.3
}

TEST(PeriodCheck, AGlitchInDriftingNoiseIsFound) {
  const Eigen::VectorXd frequency_hz = Eigen::VectorXd::LinSpaced(100, 1.0, 100.0);
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    auto periods = drifting_periods(4, 1.0, seed);
    for (Eigen::Index k = 0; k < 100; ++k)  // of 300 standard deviations at sample 40
      periods[2](0, k) += 300.0 * std::polar(1.0, -2.0 * std::numbers::pi * 40.0 *
                                                      static_cast<double>(k + 1) / 256.0);
    const auto found = find_outliers(periods, frequency_hz);
    ASSERT_EQ(found.size(), 1U) << seed;
    EXPECT_EQ(found[0].period, 2U);
  }
}

TEST(PeriodCheck, ANoisierPeriodIsFoundWhereItStandsOut) {
  for (const int count : {3, 4, 5, 10}) {
    for (std::uint64_t seed = 1; seed <= 50; ++seed) {
      auto periods = clean_periods(count, seed);
      test::ComplexNoise random(1000 + seed);
      for (Eigen::Index k = 31; k < kLines; ++k)
        periods[1](2, k) += 0.1 / static_cast<double>(k + 1) * random.gaussian();
      const auto found = find_outliers(periods, frequencies());
      ASSERT_EQ(found.size(), 1u) << count << " periods, seed " << seed;
      EXPECT_EQ(found[0].period, 1u);
      EXPECT_EQ(found[0].channel, 2);
      EXPECT_GT(found[0].ratio, 5.0);
      EXPECT_GT(found[0].last_line, 31);
    }
  }
}

TEST(PeriodCheck, SeveralAreFoundButNeverHalfOfAll) {
  auto periods = clean_periods(10, 7);
  for (const std::size_t p : {2u, 3u, 8u})
    periods[p].row(0).array() += 5.0 + static_cast<double>(p);
  const auto found = find_outliers(periods, frequencies());
  std::vector<std::size_t> which;
  for (const PeriodOutlier& outlier : found) which.push_back(outlier.period);
  EXPECT_THAT(which, testing::UnorderedElementsAre(2u, 3u, 8u));
  auto torn = clean_periods(4, 7);
  for (std::size_t p = 0; p < 4; ++p) torn[p].row(1).array() += std::pow(50.0, double(p));
  EXPECT_EQ(find_outliers(torn, frequencies()).size(), 1u);
  auto two = clean_periods(2, 7);
  two[0].array() += 100.0;
  EXPECT_TRUE(find_outliers(two, frequencies()).empty());
}

TEST(PeriodCheck, WithoutNoiseRoundingIsNotAnOutlier) {
  const Eigen::MatrixXcd same = Eigen::MatrixXcd::Constant(1, kLines, {1.0, 2.0});
  std::vector<Eigen::MatrixXcd> periods(5, same);
  periods[3].array() *= 1.0 + 1e-15;
  EXPECT_TRUE(find_outliers(periods, frequencies()).empty());
}

/// A loop with noise whose power rises towards low frequencies: first-order, corner at 1 % of the
/// sample rate, so that periods do not end where they began.
MemoryLog coloured_log(std::uint64_t seed, int periods) {
  const test::SampledPlant plant =
      test::sampled_plant(2, 2, {{12.3, 0.1}, {37.0, 0.1}}, 200.0, 0.5);
  LoopExperiment x{.sample_rate_hz = 200.0, .period_samples = 400, .axes = 2};
  x.lines = test::line_range(1, 151, 2);
  x.periods = periods;
  x.transient_periods = 3;
  x.seed = seed;
  MemoryLog log = test::simulate_sampled_log(plant, x, 0.01);
  test::ComplexNoise random(seed + 5000);
  for (LogSamples& record : log.records) {
    for (Eigen::Index i = 0; i < 2; ++i) {
      double slow = 0.0;
      for (Eigen::Index n = 0; n < record.sensors.rows(); ++n) {
        slow = 0.94 * slow + 0.01 * test::real_gaussian(random);
        record.sensors(n, i) += slow;
      }
    }
  }
  return log;
}

TEST(PeriodCheck, ColouredNoiseCostsNoPeriod) {
  std::size_t dropped = 0;
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    const MemoryLog log = coloured_log(seed, 4);
    dropped += estimate_plant_frf({&log}, {.threads = 1}).dropped_periods.size();
  }
  EXPECT_LE(dropped, 3u);  // 300 runs, 0.3 expected at most
}

/// The sixth period of the second run spoilt: one sample far off, or the stage pushed so that its
/// first mode rings.
void spoil(MemoryLog& log, bool bump) {
  Eigen::MatrixXd& y = log.records[1].sensors;
  const Eigen::Index first = (3 + 5) * 400;
  if (!bump) {
    y(first + 123, 0) += 40.0;
    return;
  }
  for (Eigen::Index n = 60; n < 400; ++n) {
    const double t = static_cast<double>(n - 60) / 200.0;
    y.row(first + n).array() += 0.5 * std::exp(-t / 0.1) * std::sin(2.0 * M_PI * 12.3 * t);
  }
}

TEST(PeriodCheck, GlitchesAndBumpsAreLeftOutWithTheirDegreeOfFreedom) {
  for (const bool bump : {false, true}) {
    MemoryLog log = coloured_log(3, 8);
    spoil(log, bump);
    const FrfEstimate frf = estimate_plant_frf({&log});
    ASSERT_EQ(frf.dropped_periods.size(), 1u);
    EXPECT_EQ(frf.dropped_periods[0].realization, 0);
    EXPECT_EQ(frf.dropped_periods[0].experiment, 1);
    EXPECT_EQ(frf.dropped_periods[0].period, 5);
    EXPECT_THAT(frf.dropped_periods[0].reason, HasSubstr("times the scatter of the other periods"));
    EXPECT_EQ(frf.periods, 7);
    EXPECT_EQ(frf.noise_dof, 7.0 + 6.0);

    MemoryLog marked = log;
    marked.records[1].marked[(3 + 5) * 400 + 7] = 1;
    const FrfEstimate by_mark = estimate_plant_frf({&marked});
    EXPECT_EQ(by_mark.response, frf.response);
    EXPECT_EQ(by_mark.noise_variance, frf.noise_variance);
    ASSERT_EQ(by_mark.dropped_periods.size(), 1u);
    EXPECT_EQ(by_mark.dropped_periods[0].reason, "a marked sample");

    const FrfEstimate all = estimate_plant_frf({&log}, {.periods = PeriodChoice::unmarked});
    EXPECT_TRUE(all.dropped_periods.empty());
    EXPECT_EQ(all.periods, 8);
    EXPECT_GT((all.noise_variance.array() / frf.noise_variance.array()).maxCoeff(), 3.0);
  }
}

// More than 16 periods are compared in groups; each is as good as one of its own.
TEST(PeriodCheck, LongRunsAreComparedInGroups) {
  MemoryLog log = coloured_log(5, 20);
  log.records[0].sensors(3 * 400 + 12, 1) += 40.0;         // in the first group
  log.records[0].sensors((3 + 19) * 400 + 12, 1) += 40.0;  // in the last
  const FrfEstimate frf = estimate_plant_frf({&log});
  ASSERT_EQ(frf.dropped_periods.size(), 2u);
  EXPECT_EQ(frf.dropped_periods[0].period, 0);
  EXPECT_EQ(frf.dropped_periods[1].period, 19);
}

}  // namespace
}  // namespace stageid
