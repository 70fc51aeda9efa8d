// frf --method lpm on records that begin at rest, without discarded periods.
#include <gtest/gtest.h>

#include <algorithm>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/models/estimate_trials.hpp"
#include "tests/support/models/expect_same_frf.hpp"

namespace stageid::test_local_polynomial {

using test::AxisScheme;
using test::LoopExperiment;
using test::MemoryLog;
using test::SampledPlant;

constexpr double kSampleRateHz = 200.0;
constexpr double kNoise = 0.01;

/// Two close modes; the slower one decays to 5 % within 3 s, the period is 4 s.
SampledPlant slow_stage() {
  return test::sampled_plant(2, 2, {{12.3, 1.0}, {13.6, 0.7}, {37.0, 0.2}}, kSampleRateHz, 0.5);
}

LoopExperiment slow_experiment(int periods) {
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 800, .axes = 2};
  x.lines = test::line_range(21, 161, 2);
  x.periods = periods;
  x.transient_periods = 0;
  return x;
}

test::Trials repeat(const LoopExperiment& x, const FrfOptions& options, int seeds) {
  return test::repeat(slow_stage(), x, kNoise, options, seeds);
}

TEST(LocalPolynomial, WithoutNoiseTheTransientIsRemoved) {
  const SampledPlant plant = slow_stage();
  const MemoryLog log = test::simulate_sampled_log(plant, slow_experiment(4), 0.0);
  const FrfEstimate lpm = estimate_plant_frf({&log}, {.method = FrfMethod::lpm});
  const FrfEstimate periodic = estimate_plant_frf({&log}, {.periods = PeriodChoice::unmarked});
  EXPECT_LT(test::largest_error(lpm, plant), 1e-5);
  EXPECT_GT(test::largest_error(periodic, plant), 0.05);  // cost of a used transient
  EXPECT_EQ(lpm.periods, 4);
  // Two runs; poles (up to four) used half a degree of freedom of ten each.
  EXPECT_LT(lpm.noise_dof, 18.0);
  EXPECT_GE(lpm.noise_dof, 0.8 * 18.0);
}

// At equal time: four periods from the start against three after a discarded one.
TEST(LocalPolynomial, IsAsAccurateAsPassingOverAPeriod) {
  constexpr int kSeeds = 40;
  const test::Trials lpm = repeat(slow_experiment(4), {.method = FrfMethod::lpm}, kSeeds);
  const test::Trials periodic = repeat(slow_experiment(4), {.transient_periods = 1}, kSeeds);
  // 71 lines x 4 entries x 40 seeds: 1 % for an rms. The modelled transient costs (1 + leverage), the additional period
  // gains 4 / 3.
  EXPECT_LT(lpm.error, 1.02 * periodic.error);
}

/// An outlier of one sensor in a period of the first run, in standard deviations of the noise.
MemoryLog with_glitch(double deviations, int period, int periods, std::uint64_t seed) {
  LoopExperiment x = slow_experiment(periods);
  x.seed = seed;
  MemoryLog log = test::simulate_sampled_log(slow_stage(), x, kNoise);
  log.records[0].sensors(period * x.period_samples + 431, 1) += deviations * kNoise;
  return log;
}

// Equal to removing the period manually; with two periods, the wrong one cannot be identified.
TEST(LocalPolynomial, LeavesPeriodsWithAGlitchOut) {
  const FrfOptions lpm{.method = FrfMethod::lpm};
  FrfOptions unmarked = lpm;
  unmarked.periods = PeriodChoice::unmarked;
  for (const int period : {0, 1, 2, 4}) {
    MemoryLog log = with_glitch(500.0, period, 5, 3);
    const FrfEstimate frf = estimate_plant_frf({&log}, lpm);
    int glitches = 0;
    for (const DroppedPeriod& dropped : frf.dropped_periods) {
      EXPECT_EQ(dropped.experiment, 0);
      if (dropped.reason.find("a glitch: z2 deviates") == std::string::npos) continue;
      EXPECT_EQ(dropped.period, period);
      ++glitches;
    }
    EXPECT_EQ(glitches, 1) << period;
    const FrfEstimate spoilt = estimate_plant_frf({&log}, unmarked);
    EXPECT_TRUE(spoilt.dropped_periods.empty());
    EXPECT_GT(spoilt.noise_variance.row(1).mean(), 1.4 * frf.noise_variance.row(1).mean());
    log.records[0].marked[period * 800 + 100] = 1;
    EXPECT_EQ(estimate_plant_frf({&log}, unmarked).response, frf.response);
  }
  const MemoryLog two = with_glitch(500.0, 1, 2, 3);
  EXPECT_TRUE(estimate_plant_frf({&two}, lpm).dropped_periods.empty());
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const MemoryLog clean = with_glitch(seed % 2 == 0 ? 0.0 : 10.0, 2, 5, seed);
    EXPECT_TRUE(estimate_plant_frf({&clean}, lpm).dropped_periods.empty()) << seed;
  }
}

/// Five modes within 30 Hz: a remainder of the transient in the window would count as noise.
SampledPlant crowded_stage() {
  return test::sampled_plant(
      3, 2, {{7.3, 0.9}, {11.2, 0.5}, {17.4, 1.5}, {26.0, 0.6}, {33.3, 0.35}}, kSampleRateHz, 0.2);
}

struct Repeated {
  SampledPlant (*plant)();
  AxisScheme scheme;
  int periods;
  int seeds;
};

class Variance : public testing::TestWithParam<Repeated> {};

// A single period too: the noise is estimated on empty lines; 18 are two records. With orthogonal axes, every axis's
// transient is in every run.
TEST_P(Variance, IsThatOverSeedsAndTheMeanIsUnbiased) {
  LoopExperiment x = slow_experiment(GetParam().periods);
  x.scheme = GetParam().scheme;
  const test::Trials trials =
      test::repeat(GetParam().plant(), x, kNoise, {.method = FrfMethod::lpm}, GetParam().seeds);
  // 284 entries of 80 seeds, transients of neighbouring lines share some 6 lines: sqrt(6 / (284 *
  // 80)) = 1.6 % (426 of 40: 1.9 %); a bias as large as the standard error would double the second.
  EXPECT_NEAR(trials.over_stated, 1.0, 0.05);
  EXPECT_NEAR(trials.bias, 1.0, 0.5);
}

std::vector<Repeated> repeated() {
  std::vector<Repeated> all;
  for (const int periods : {1, 2, 4, 18}) {
    for (const AxisScheme scheme : {AxisScheme::single_axis, AxisScheme::orthogonal})
      all.push_back({slow_stage, scheme, periods, 80});
    if (periods <= 4) all.push_back({crowded_stage, AxisScheme::orthogonal, periods, 40});
  }
  return all;
}
INSTANTIATE_TEST_SUITE_P(Records, Variance, testing::ValuesIn(repeated()));

// A marked period, of any content, ends one record and begins another; both are used.
TEST(LocalPolynomial, StretchesBesideAMarkedPeriodAreBothUsed) {
  MemoryLog log = test::simulate_sampled_log(slow_stage(), slow_experiment(6), kNoise);
  for (std::size_t run = 0; run < 2; ++run) {
    log.records[run].marked[2 * 800 + 17] = 1;
    log.records[run].sensors.middleRows(2 * 800, 800).setConstant(1e6);
  }
  const FrfEstimate marked = estimate_plant_frf({&log}, {.method = FrfMethod::lpm});
  EXPECT_EQ(marked.periods, 5);
  EXPECT_LE(marked.noise_dof, 2 * 2 * 9.0);
  EXPECT_GT(marked.noise_dof, 0.95 * 2 * 2 * 9.0);  // poles are needed on few lines
  ASSERT_EQ(marked.dropped_periods.size(), 2u);
  EXPECT_EQ(marked.dropped_periods[0].period, 2);
  // 284 entries of lines that share some 6: standard deviation 15 %.
  EXPECT_NEAR(test::error_over_variance(marked, slow_stage()), 1.0, 0.5);
}

TEST(LocalPolynomial, APeriodOnItsOwnIsLeftOutUnlessNothingElseIsThere) {
  MemoryLog log = test::simulate_sampled_log(slow_stage(), slow_experiment(4), kNoise);
  for (std::size_t run = 0; run < 2; ++run) log.records[run].marked[800 + 5] = 1;
  const FrfEstimate two = estimate_plant_frf({&log}, {.method = FrfMethod::lpm});
  EXPECT_EQ(two.periods, 2);
  EXPECT_EQ(two.dropped_periods.size(), 4u);
  for (std::size_t run = 0; run < 2; ++run) log.records[run].marked[2 * 800 + 5] = 1;
  const FrfEstimate one = estimate_plant_frf({&log}, {.method = FrfMethod::lpm});
  EXPECT_EQ(one.periods, 1);
}

TEST(LocalPolynomial, TheNumberOfThreadsDoesNotMatter) {
  const MemoryLog log = test::simulate_sampled_log(slow_stage(), slow_experiment(2), kNoise);
  const FrfEstimate one = estimate_plant_frf({&log}, {.method = FrfMethod::lpm, .threads = 1});
  test::expect_same(one, estimate_plant_frf({&log}, {.method = FrfMethod::lpm, .threads = 3}));
  EXPECT_NE(one.provenance_json.find(R"("method":"lpm")"), std::string::npos);
}

}  // namespace stageid::test_local_polynomial
