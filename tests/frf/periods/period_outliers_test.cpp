#include "frf/periods/period_outliers.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "excitation/multisine/dft.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_period_outliers {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;

constexpr Eigen::Index kSamples = 1024;
constexpr Eigen::Index kLines = 400;

/// Noise of one channel and run, `count` samples.
using Noise = Eigen::VectorXd (*)(Eigen::Index count, test::ComplexNoise& random);

Eigen::VectorXd white(Eigen::Index count, test::ComplexNoise& random) {
  return Eigen::VectorXd::NullaryExpr(count, [&] { return test::real_gaussian(random); });
}

Eigen::VectorXd drifting(Eigen::Index count, test::ComplexNoise& random) {
  Eigen::VectorXd x = white(count, random);
  for (Eigen::Index n = 1; n < count; ++n) x[n] += x[n - 1];
  return x + white(count, random);
}

/// 1 / (1 - pole / z)^2 or with a pair of poles, a hundred times white noise.
Eigen::VectorXd resonant(Eigen::Index count, std::complex<double> pole,
                         test::ComplexNoise& random) {
  constexpr Eigen::Index kSettling = 5000;
  Eigen::VectorXd x = white(count + kSettling, random);
  for (Eigen::Index n = 2; n < x.size(); ++n)
    x[n] += 2.0 * pole.real() * x[n - 1] - std::norm(pole) * x[n - 2];
  const double deviation = x.norm() / std::sqrt(static_cast<double>(x.size()));
  return 100.0 / deviation * x.tail(count) + white(count, random);
}

/// 1/f: first-order noises, one per octave.
Eigen::VectorXd flicker(Eigen::Index count, test::ComplexNoise& random) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(count);
  for (double pole = 0.5; pole < 0.9999; pole = std::sqrt(pole)) {
    double state = test::real_gaussian(random);
    for (double& value : x) {
      state = pole * state + std::sqrt(1.0 - pole * pole) * test::real_gaussian(random);
      value += state;
    }
  }
  return x;
}

/// A correlation time of a tenth of a period: its power is on the first few lines, and leaks.
Eigen::VectorXd slow(Eigen::Index count, test::ComplexNoise& random) {
  return resonant(count, 0.99, random);
}

/// Between two lines, and narrower than their distance.
Eigen::VectorXd narrow(Eigen::Index count, test::ComplexNoise& random) {
  return resonant(count, std::polar(0.9995, 2.0 * std::numbers::pi * 2.5 / kSamples), random);
}

Eigen::VectorXd loop(Eigen::Index count, test::ComplexNoise& random) {
  return resonant(count, std::polar(0.998, 2.0 * std::numbers::pi * 60.3 / kSamples), random);
}

/// Periods of a run with one kind of noise in every channel.
struct NoisyRun {
  std::vector<Eigen::MatrixXf> samples;
  std::vector<Eigen::MatrixXcd> spectra;
  std::vector<int> number;

  void add(Eigen::Index p, Eigen::Index n, Eigen::Index channel, double value) {
    samples[static_cast<std::size_t>(p)](n, channel) += static_cast<float>(value);
  }
  std::vector<PeriodOutlier> outliers() {
    RealDft dft(static_cast<int>(kSamples));
    spectra.clear();
    for (const Eigen::MatrixXf& period : samples) {
      Eigen::MatrixXcd& Z = spectra.emplace_back(period.cols(), kLines);
      for (Eigen::Index c = 0; c < period.cols(); ++c) {
        std::copy_n(period.col(c).data(), kSamples, dft.input().begin());
        const auto transformed = dft.forward();
        for (Eigen::Index k = 0; k < kLines; ++k)
          Z(c, k) = transformed[static_cast<std::size_t>(k + 1)];
      }
    }
    return find_outliers({spectra, samples, number,
                          Eigen::VectorXd::LinSpaced(kLines, 1.0, static_cast<double>(kLines)),
                          kSamples})
        .found;
  }
  std::vector<std::size_t> which() {
    std::vector<std::size_t> periods;
    for (const PeriodOutlier& outlier : outliers()) periods.push_back(outlier.period);
    return periods;
  }
};

NoisyRun run_of(Noise noise, int periods, Eigen::Index channels, std::uint64_t seed) {
  test::ComplexNoise random(seed);
  NoisyRun run;
  Eigen::MatrixXf record(periods * kSamples, channels);
  for (Eigen::Index c = 0; c < channels; ++c)
    record.col(c) = noise(record.rows(), random).cast<float>();
  for (int p = 0; p < periods; ++p) {
    run.samples.emplace_back(record.middleRows(p * kSamples, kSamples));
    run.number.push_back(p);
  }
  return run;
}

class Colour : public testing::TestWithParam<Noise> {};
INSTANTIATE_TEST_SUITE_P(Noises, Colour,
                         testing::Values(white, flicker, drifting, slow, narrow, loop));

TEST_P(Colour, CleanPeriodsStay) {
  constexpr int kRuns = 60;
  std::size_t dropped = 0;
  for (const int count : {3, 4, 6, 12})
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed)
      dropped += run_of(GetParam(), count, 2, seed).outliers().size();
  // kDropByChance bounds the mean by 0.24: more than 2 has a probability of 2e-3.
  EXPECT_LE(dropped, 2U);
}

// A spike, a bump and a step, each ten times as large in its period as the noise.
TEST_P(Colour, GlitchesAreFound) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    for (const Eigen::Index width : {1, 5, 40}) {
      NoisyRun run = run_of(GetParam(), 6, 2, seed);
      const double size = 1000.0 * std::sqrt(10.0 / static_cast<double>(width));
      const auto first = static_cast<Eigen::Index>(37 * seed + 200);
      for (Eigen::Index n = 0; n < width; ++n)
        run.add(3, first + n, 1,
                size * std::sin(std::numbers::pi * (static_cast<double>(n) + 0.5) /
                                static_cast<double>(width)));
      const auto found = run.outliers();
      ASSERT_EQ(found.size(), 1U) << "seed " << seed << ", " << width << " samples";
      EXPECT_EQ(found[0].period, 3U);
      EXPECT_EQ(found[0].channel, 1);
      EXPECT_GT(found[0].ratio, 2.0);
      EXPECT_GT(found[0].high_hz, found[0].low_hz);
      EXPECT_LE(found[0].where.first, first + width / 2);
      EXPECT_GT(found[0].where.end, first + width / 2);
    }
  }
}

// So smooth that only octaves whose last wavelet ends some samples before the period show it.
TEST(Outliers, ADeviationInTheLastCoefficientReachesTheEnd) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    NoisyRun run = run_of(white, 8, 1, seed);
    for (Eigen::Index n = 0; n < 160; ++n) {
      const double sine = std::sin(std::numbers::pi * (static_cast<double>(n) + 0.5) / 160.0);
      run.add(3, kSamples - 160 + n, 0, 80.0 * sine * sine);
    }
    const std::vector<PeriodOutlier> found = run.outliers();
    ASSERT_EQ(found.size(), 1U) << seed;
    EXPECT_EQ(found[0].where.end, kSamples) << seed;
  }
}

/// `factor` times as much white noise in one period.
NoisyRun run_with_a_noisy_period(int periods, double factor, std::uint64_t seed) {
  NoisyRun run = run_of(white, periods, 1, seed);
  run.samples[1] *= static_cast<float>(std::sqrt(factor));
  return run;
}

// From the first to the last one of any channel.
TEST(Outliers, TheDeviatingSamplesAreThoseOfAllChannels) {
  NoisyRun run = run_of(white, 6, 2, 7);
  run.add(2, 300, 0, 1000.0);
  run.add(2, 500, 1, 1000.0);
  const std::vector<PeriodOutlier> found = run.outliers();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_LE(found[0].where.first, 300);
  EXPECT_GE(found[0].where.first, 290);
  EXPECT_GT(found[0].where.end, 500);
  EXPECT_LE(found[0].where.end, 511);
}

// For the variance of the mean, n + 1 periods with 2 + 1 / n times the noise in one are as bad as n periods.
TEST(Outliers, PeriodsThatCostLessThanTheirLossStay) {
  int dropped_below = 0;
  int dropped_above = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    dropped_below += static_cast<int>(run_with_a_noisy_period(8, 1.6, seed).which().size());
    dropped_above += static_cast<int>(run_with_a_noisy_period(8, 5.0, seed).which().size());
  }
  EXPECT_LE(dropped_below, 1);
  EXPECT_GE(dropped_above, 49);
}

TEST(Outliers, SeveralAreFoundButNeverHalfOfAll) {
  NoisyRun run = run_of(drifting, 10, 2, 7);
  for (const Eigen::Index p : {2, 3, 8}) run.add(p, 500, 0, 3000.0);
  EXPECT_THAT(run.which(), testing::ElementsAre(2U, 3U, 8U));
  NoisyRun five = run_of(white, 5, 1, 7);  // two equal outliers, compared with each other too
  for (const Eigen::Index p : {1, 3}) five.add(p, 500, 0, 1000.0);
  EXPECT_THAT(five.which(), testing::ElementsAre(1U, 3U));
  NoisyRun torn = run_of(white, 4, 1, 7);
  for (Eigen::Index p = 0; p < 4; ++p) torn.add(p, 300, 0, std::pow(50.0, static_cast<double>(p)));
  EXPECT_THAT(torn.which(), testing::ElementsAre(3U));
  NoisyRun two = run_of(white, 2, 1, 7);
  two.add(0, 500, 0, 1000.0);
  EXPECT_TRUE(two.outliers().empty());
}

// A missing period separates the record; the neighbours of a glitch at the border are kept.
TEST(Outliers, OnlyThePeriodWithTheGlitchIsFound) {
  for (const Eigen::Index at : {Eigen::Index{0}, Eigen::Index{3}, kSamples - 1}) {
    NoisyRun run = run_of(slow, 8, 1, 3);
    run.number = {0, 1, 2, 4, 5, 6, 7, 8};
    run.add(5, at, 0, 20000.0);
    EXPECT_THAT(run.which(), testing::ElementsAre(5U)) << at;
  }
}

TEST(Outliers, WithoutNoiseRoundingIsNotAnOutlier) {
  NoisyRun run =
      run_of([](Eigen::Index count,
                test::ComplexNoise&) -> Eigen::VectorXd { return Eigen::VectorXd::Ones(count); },
             5, 1, 1);
  EXPECT_TRUE(run.outliers().empty());
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

TEST(Outliers, ColouredNoiseCostsNoPeriod) {
  std::size_t dropped = 0;
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    const MemoryLog log = coloured_log(seed, 4);
    dropped += estimate_plant_frf({&log}, {.threads = 1}).dropped_periods.size();
  }
  EXPECT_LE(dropped, 3u);  // 300 runs, at most 0.3 expected
}

/// One run of six periods of 4000 samples at 8 kHz, through a gain of 1, with slow noise below 16 Hz.
MemoryLog slow_log(std::uint64_t seed) {
  constexpr int kPeriod = 4000;
  test::ComplexNoise random(seed);
  RealDft dft(kPeriod);
  MemoryLog log;
  log.log_info.sample_rate_hz = 8000.0;
  log.log_info.period_samples = kPeriod;
  log.log_info.excitation = log.log_info.actuators = test::channels("a", 1, "N");
  log.log_info.sensors = test::channels("z", 1, "m");
  const auto lines = test::line_range(1, 600, 1);
  Eigen::MatrixXcd R(1, std::ssize(lines));
  for (auto& value : R.reshaped()) value = random.phase();
  const Eigen::MatrixXd period = test::synthesize(R, lines, dft);
  LogSamples record;
  record.actuators = period.replicate(6, 1);
  const double hz = 1.0 + 15.0 * random.uniform();
  record.sensors =
      record.actuators + resonant(record.actuators.rows(),
                                  std::exp(std::complex<double>(-1.0, 1.0) * hz / 1800.0), random);
  log.append(0, 0, period, record);
  return log;
}

/// A half sine of 10 ms, `deviations` of that noise high.
void add_half_sine(MemoryLog& log, Eigen::Index first, double deviations) {
  for (int n = 0; n < 80; ++n)
    log.records[0].sensors(first + n, 0) +=
        deviations * 100.0 * std::sin(std::numbers::pi * (n + 0.5) / 80.0);
}

Eigen::ArrayXd squared_errors(const MemoryLog& log, PeriodChoice periods) {
  const FrfEstimate frf = estimate_plant_frf({&log}, {.periods = periods, .threads = 1});
  return (frf.response.row(0).transpose().array() - 1.0).abs2();
}

// Slow noise leaks into all lines; the leakage of neighbouring periods cancels in their mean, so a dropped period costs
// more than its share.
TEST(Outliers, SlowNoiseAndItsGlitchesCostNoAccuracy) {
  for (const double deviations : {5.0, 50.0, 500.0}) {
    Eigen::ArrayXd plain = Eigen::ArrayXd::Zero(600);
    Eigen::ArrayXd clean = plain;
    Eigen::ArrayXd glitched = plain;
    for (std::uint64_t seed = 1; seed <= 26; ++seed) {
      MemoryLog log = slow_log(seed);
      plain += squared_errors(log, PeriodChoice::unmarked);
      clean += squared_errors(log, PeriodChoice::consistent);
      add_half_sine(log, 3 * 4000 + 700, deviations);
      glitched += squared_errors(log, PeriodChoice::consistent);
    }
    EXPECT_LE((clean / plain).sqrt().mean(), 1.01) << deviations;
    EXPECT_LE((glitched / plain).sqrt().mean(), 1.1) << deviations;
  }
}

TEST(Outliers, BumpsAreLeftOutWithTheirDegreeOfFreedom) {
  MemoryLog log = coloured_log(3, 8);
  for (Eigen::Index n = 60; n < 400; ++n) {  // of the sixth period of the second run
    const double t = static_cast<double>(n - 60) / 200.0;
    log.records[1].sensors.row((3 + 5) * 400 + n).array() +=
        0.5 * std::exp(-t / 0.1) * std::sin(2.0 * M_PI * 12.3 * t);
  }
  const FrfEstimate frf = estimate_plant_frf({&log});
  ASSERT_EQ(frf.dropped_periods.size(), 1u);
  EXPECT_TRUE(frf.replaced_samples.empty());
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

TEST(Outliers, OnlyTheSamplesOfAGlitchAreReplaced) {
  MemoryLog log = coloured_log(3, 8);
  const FrfEstimate clean = estimate_plant_frf({&log});
  log.records[1].sensors((3 + 5) * 400 + 123, 0) += 40.0;
  const FrfEstimate frf = estimate_plant_frf({&log});
  EXPECT_TRUE(frf.dropped_periods.empty());
  ASSERT_EQ(frf.replaced_samples.size(), 1u);
  const ReplacedSamples& replaced = frf.replaced_samples[0];
  EXPECT_EQ(replaced.realization, 0);
  EXPECT_EQ(replaced.experiment, 1);
  EXPECT_EQ(replaced.period, 5);
  EXPECT_LE(replaced.first, 123);
  EXPECT_GT(replaced.first + replaced.samples, 123);
  EXPECT_LE(replaced.samples, 40);
  EXPECT_THAT(replaced.reason, HasSubstr("times the scatter of the other periods"));
  EXPECT_EQ(frf.periods, 8);
  EXPECT_EQ(frf.noise_dof, clean.noise_dof);
  const Eigen::ArrayXXd change = (frf.response - clean.response).array().abs2();
  EXPECT_LT(change.sum(), 0.01 * clean.noise_variance.sum());
  EXPECT_NEAR(frf.noise_variance.sum() / clean.noise_variance.sum(), 1.0, 0.05);
  const FrfEstimate unmarked = estimate_plant_frf({&log}, {.periods = PeriodChoice::unmarked});
  EXPECT_TRUE(unmarked.replaced_samples.empty());
  EXPECT_GT((unmarked.noise_variance.array() / clean.noise_variance.array()).maxCoeff(), 3.0);
}

/// Expects that no samples are replaced, and these periods of a run are dropped.
void expect_dropped(const MemoryLog& log, const std::vector<int>& periods) {
  const FrfEstimate frf = estimate_plant_frf({&log});
  EXPECT_TRUE(frf.replaced_samples.empty());
  ASSERT_EQ(frf.dropped_periods.size(), periods.size());
  for (std::size_t i = 0; i < periods.size(); ++i)
    EXPECT_EQ(frf.dropped_periods[i].period, periods[i]);
}

// What began before the period, or goes on after it, is no glitch.
TEST(Outliers, ADeviationAtAnEndOfAPeriodCostsTheWholePeriod) {
  for (const Eigen::Index at : {0, 399}) {
    SCOPED_TRACE(at);
    MemoryLog log = coloured_log(3, 8);
    log.records[1].sensors((3 + 5) * 400 + at, 0) += 40.0;
    expect_dropped(log, {5});
  }
}

// The first period of a run is the one that the others are compared with.
// The first period of a run is the one that the others are compared with. Of two, neither may be replaced by a mean
// that contains the other.
TEST(Outliers, GlitchesInOnePlaceAreReplacedByTheOtherPeriods) {
  const MemoryLog sound = coloured_log(3, 8);
  const FrfEstimate clean = estimate_plant_frf({&sound});
  for (const std::vector<int>& periods : {std::vector{0}, {2, 6}}) {
    MemoryLog log = sound;
    for (const int period : periods) log.records[1].sensors((3 + period) * 400 + 200, 0) += 40.0;
    const FrfEstimate frf = estimate_plant_frf({&log});
    EXPECT_TRUE(frf.dropped_periods.empty());
    EXPECT_EQ(frf.replaced_samples.size(), periods.size());
    EXPECT_EQ(frf.response, estimate_plant_frf({&log}, {.threads = 4}).response);
    EXPECT_LT((frf.response - clean.response).squaredNorm() / clean.noise_variance.sum(),
              0.01 * static_cast<double>(periods.size()));
  }
}

TEST(Outliers, ADeviationOfMoreThanATenthCostsThePeriod) {
  for (const int width : {30, 60}) {
    MemoryLog log = coloured_log(3, 8);
    for (int n = 0; n < width; ++n)
      log.records[1].sensors((3 + 5) * 400 + 150 + n, 0) += 40.0 * (n % 2 == 0 ? 1.0 : -1.0);
    const FrfEstimate frf = estimate_plant_frf({&log});
    EXPECT_EQ(frf.replaced_samples.size(), width < 40 ? 1U : 0U);
    EXPECT_EQ(frf.dropped_periods.size(), width < 40 ? 0U : 1U);
  }
}

// Some of its samples stand out by themselves, but replacing them is not enough.
TEST(Outliers, ANoisyPeriodIsDroppedWhole) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    MemoryLog log = coloured_log(3, 8);
    test::ComplexNoise random(seed);
    for (int n = 0; n < 400; ++n)
      log.records[1].sensors((3 + 5) * 400 + n, 0) += 0.1 * test::real_gaussian(random);
    SCOPED_TRACE(seed);
    expect_dropped(log, {5});
  }
}

// Smooth, so that only octaves with long wavelets show it.
TEST(Outliers, ADeviationAcrossTheEndOfAPeriodCostsBoth) {
  for (const double deviations : {5.0, 50.0}) {
    MemoryLog log = slow_log(5);
    add_half_sine(log, 4 * 4000 - 40, deviations);
    SCOPED_TRACE(deviations);
    expect_dropped(log, {3, 4});
  }
}

// More than 16 periods are compared in groups; in each, outliers are found as in a separate run.
TEST(Outliers, LongRunsAreComparedInGroups) {
  MemoryLog log = coloured_log(5, 20);
  log.records[0].sensors(3 * 400 + 112, 1) += 40.0;         // in the first group
  log.records[0].sensors((3 + 19) * 400 + 112, 1) += 40.0;  // in the last
  const FrfEstimate frf = estimate_plant_frf({&log});
  ASSERT_EQ(frf.replaced_samples.size(), 2u);
  EXPECT_EQ(frf.replaced_samples[0].period, 0);
  EXPECT_EQ(frf.replaced_samples[1].period, 19);
}

}  // namespace stageid::test_period_outliers
