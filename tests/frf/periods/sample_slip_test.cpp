// A recorder that loses or duplicates samples: reported, and the rest is used.
#include "frf/periods/sample_slip.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "frf/health/data_health.hpp"
#include "frf/periods/period_slip.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/logs/told_findings.hpp"
#include "tests/support/models/estimate_trials.hpp"

namespace stageid::test_sample_slip {

using Eigen::Index;
using test::MemoryLog;
using test::text;

test::LoopExperiment experiment(std::uint64_t seed) {
  test::LoopExperiment x{.sample_rate_hz = 2000.0, .period_samples = 2000, .axes = 2, .seed = seed};
  x.lines = test::line_range(3, 401, 2);
  x.realizations = 2;
  x.periods = 4;
  return x;
}

/// Plant and noise drawn from `seed`.
struct Case {
  explicit Case(std::uint64_t seed) : x(experiment(seed)) {
    test::ComplexNoise random(seed + 100);
    const double first_hz = 60.0 + 60.0 * random.uniform();
    plant = test::sampled_plant(3, 2, {{first_hz, 0.05}, {2.1 * first_hz, 0.04}}, x.sample_rate_hz,
                                0.02);
    log = test::simulate_sampled_log(plant, x, 1e-4 * std::pow(30.0, random.uniform()));
  }
  test::LoopExperiment x;
  test::SampledPlant plant;
  MemoryLog log;
};

/// Removes rows from a run, starting at `row`. A negative count duplicates the rows before it. The end is filled with
/// the rows of a longer record.
void lose(MemoryLog& log, std::size_t run, Index row, Index count, bool sensors = true,
          bool actuators = true) {
  const auto shift = [&](Eigen::MatrixXd& x) {
    const Index rows = x.rows();
    const Index N = log.log_info.period_samples;
    Eigen::MatrixXd spoilt = x;
    for (Index n = row; n < rows; ++n) {
      Index from = n + count;
      while (from >= rows) from -= N;
      spoilt.row(n) = x.row(from);
    }
    x = spoilt;
  };
  if (sensors) shift(log.records[run].sensors);
  if (actuators) shift(log.records[run].actuators);
}

std::vector<Finding> told(const HealthRecord& record) {
  return test::told(check_health(record, std::nullopt));
}

TEST(SampleSlip, CleanRunsHaveNone) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Case c(seed);
    const FrfAndHealth both = estimate_plant_frf_and_health({&c.log});
    EXPECT_TRUE(both.health.slips.empty()) << seed;
    EXPECT_TRUE(told(both.health).empty()) << seed << "\n" << text(told(both.health));
  }
}

// Slow signals and noise, recorded in steps: in a few rows they repeat exactly, shifted or not.
TEST(SampleSlip, CoarseStepsAreNoSlip) {
  constexpr Index kRows = 500;
  RealDft dft(kRows);
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    test::ComplexNoise random(seed);
    const auto period = [&] {
      LogSamples samples;
      samples.sensors.resize(kRows, 2);
      samples.actuators.resize(kRows, 2);
      for (Index n = 0; n < kRows; ++n)
        for (Index c = 0; c < 2; ++c) {
          const double slow = std::sin(2.0 * std::numbers::pi * static_cast<double>(3 * n) / kRows +
                                       static_cast<double>(c));
          samples.sensors(n, c) = std::round(slow + 0.3 * random.gaussian().real());
          samples.actuators(n, c) = slow + 0.3 * random.gaussian().real();
        }
      return samples;
    };
    const LogSamples earlier = period();
    EXPECT_FALSE(find_slip(earlier, period(), dft).has_value()) << seed;
  }
}

TEST(SampleSlip, OneLostSampleIsToldWithItsRowAndTheRestIsUsed) {
  int exact = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Case c(seed);
    test::ComplexNoise random(seed);
    const auto run = static_cast<std::size_t>(4.0 * random.uniform());
    const auto row = static_cast<Index>((1.05 + 3.9 * random.uniform()) * c.x.period_samples);
    lose(c.log, run, row, 1);
    const FrfAndHealth both = estimate_plant_frf_and_health({&c.log});
    const std::vector<Finding> findings = told(both.health);
    ASSERT_EQ(findings.size(), 1U) << seed << " row " << row << "\n" << text(findings);
    EXPECT_EQ(findings.front().cause, Cause::lost_samples);
    ASSERT_EQ(both.health.slips.size(), 1U);
    const SampleSlip& slip = both.health.slips.front();
    EXPECT_EQ(slip.run, c.log.log_runs[run].name);
    EXPECT_EQ(slip.lost, 1);
    EXPECT_NEAR(static_cast<double>(slip.row), static_cast<double>(row), 200.0) << seed;
    exact += std::abs(static_cast<double>(slip.row) - static_cast<double>(row)) <= 20.0 ? 1 : 0;
    EXPECT_LE(both.frf.dropped_periods.size(), 1U) << seed;
    const double ratio = test::error_over_variance(both.frf, c.plant);
    EXPECT_LT(ratio, 1.6) << seed;
    EXPECT_GT(ratio, 0.6) << seed;
  }
  EXPECT_GE(exact, 36);
}

TEST(SampleSlip, SeveralLostOrDoubledSamplesOfAllOrOneKindOfChannels) {
  struct Kind {
    Index count;
    bool sensors, actuators;
  };
  for (const Kind& kind : {Kind{3, true, true}, Kind{-1, true, true}, Kind{57, true, true},
                           Kind{-200, true, true}, Kind{1, true, false}, Kind{1, false, true}}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      Case c(seed);
      const Index row = 4500 + 313 * static_cast<Index>(seed);
      lose(c.log, 1, row, kind.count, kind.sensors, kind.actuators);
      const FrfAndHealth both = estimate_plant_frf_and_health({&c.log});
      ASSERT_EQ(both.health.slips.size(), 1U) << kind.count << " " << seed;
      const SampleSlip& slip = both.health.slips.front();
      EXPECT_EQ(slip.lost, kind.count) << seed;
      EXPECT_EQ(slip.sensors, kind.sensors) << kind.count << " " << seed;
      EXPECT_EQ(slip.actuators, kind.actuators) << kind.count << " " << seed;
      EXPECT_NEAR(static_cast<double>(slip.row), static_cast<double>(row), 200.0);
      EXPECT_LT(test::error_over_variance(both.frf, c.plant), 1.6) << kind.count << " " << seed;
    }
  }
}

// A channel with its own recorder or filter.
TEST(SampleSlip, OneChannelMayLoseSamplesAlone) {
  for (const bool of_sensor : {true, false})
    for (const Index count : {1, -1, 3})
      for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        Case c(seed);
        const Index row = 2300 + 1013 * static_cast<Index>(seed);
        MemoryLog whole = c.log;
        lose(whole, 1, row, count);
        if (of_sensor)
          c.log.records[1].sensors.col(1) = whole.records[1].sensors.col(1);
        else
          c.log.records[1].actuators.col(1) = whole.records[1].actuators.col(1);
        const FrfAndHealth both = estimate_plant_frf_and_health({&c.log});
        ASSERT_EQ(both.health.slips.size(), 1U) << of_sensor << " " << count << " " << seed;
        const SampleSlip& slip = both.health.slips.front();
        EXPECT_EQ(slip.channel, of_sensor ? "z2" : "a2");
        EXPECT_EQ(slip.lost, count) << seed;
        EXPECT_NEAR(static_cast<double>(slip.row), static_cast<double>(row), 200.0) << seed;
        EXPECT_NE(to_string(slip).find(of_sensor ? " of z2 " : " of a2 "), std::string::npos);
        EXPECT_LT(test::error_over_variance(both.frf, c.plant), 1.6)
            << of_sensor << " " << count << " " << seed;
        EXPECT_EQ(told(both.health).size(), 1U) << text(told(both.health));
      }
}

TEST(SampleSlip, IsTheSameForBothMethodsAndForTheRecordAlone) {
  Case c(3);
  lose(c.log, 2, 5100, 1);
  const auto rows = [](const HealthRecord& record) {
    std::vector<std::uint64_t> all;
    for (const SampleSlip& slip : record.slips) all.push_back(slip.row);
    return all;
  };
  const std::vector<std::uint64_t> one = rows(read_health_record({&c.log}, {}));
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(rows(estimate_plant_frf_and_health({&c.log}).health), one);
  const FrfAndHealth lpm =
      estimate_plant_frf_and_health({&c.log}, {.transient_periods = 1, .method = FrfMethod::lpm});
  EXPECT_EQ(rows(lpm.health), one);
  EXPECT_LT(test::error_over_variance(lpm.frf, c.plant), 1.6);
}

}  // namespace stageid::test_sample_slip
