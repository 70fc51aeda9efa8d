#include "frf/runs/health_record.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/models/expect_same_frf.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_health_record {

using test::LoopExperiment;
using test::MemoryLog;

/// Three actuators, of which two are excited; two sensors; a marked period.
MemoryLog recorded_log() {
  LoopExperiment x{.axes = 2, .realizations = 2, .periods = 4};
  x.lines = test::line_range(1, 119, 2);
  x.noise_factor = 0.1 * Eigen::MatrixXcd::Identity(2, 2);
  MemoryLog log = test::simulate_log(test::small_stage(), x);
  log.records[1].marked[2 * log.log_info.period_samples + 17] = 1;
  return log;
}

void expect_equal(const HealthRecord& a, const HealthRecord& b) {
  test::expect_same(a, b);
  EXPECT_EQ(a.health.marked, b.health.marked);
  ASSERT_EQ(a.others.size(), b.others.size());
  for (std::size_t m = 0; m < a.others.size(); ++m) test::expect_same(a.others[m], b.others[m]);
  ASSERT_EQ(a.scan.size(), b.scan.size());
  for (std::size_t c = 0; c < a.scan.size(); ++c) {
    EXPECT_EQ(a.scan[c].samples(), b.scan[c].samples());
    EXPECT_EQ(a.scan[c].high().value, b.scan[c].high().value);
    EXPECT_EQ(a.scan[c].low().value, b.scan[c].low().value);
    EXPECT_EQ(a.scan[c].longest_constant(), b.scan[c].longest_constant());
  }
}

// By the definition, independently of the library: a DFT sum.
std::complex<double> dft_of(const Eigen::VectorXd& samples, int line) {
  std::complex<double> sum = 0.0;
  const auto N = static_cast<double>(samples.size());
  for (Eigen::Index n = 0; n < samples.size(); ++n)
    sum += samples[n] * std::polar(1.0, -2.0 * M_PI * line * static_cast<double>(n) / N);
  return sum / N;
}

TEST(HealthRecord, HoldsTheSpectraOfEveryChannelAndCleanPeriod) {
  const MemoryLog log = recorded_log();
  const HealthRecord record = estimate_plant_frf_and_health({&log}).health;
  const Eigen::Index N = log.log_info.period_samples;
  const Eigen::Index skipped = log.log_info.transient_periods;
  ASSERT_EQ(record.periods, (std::vector<int>{4, 3}));
  ASSERT_EQ(record.lines.size(), 60U);
  ASSERT_EQ(record.lines[3].Z.rows(), 2 + 3);
  for (const Eigen::Index column : {0, 2, 4, 6}) {
    // The second run lacks the marked period after the transient.
    const bool second = column >= 4;
    const Eigen::Index period =
        skipped + (second ? column - 4 + (column - 4 >= 2 - skipped ? 1 : 0) : column);
    const LogSamples& samples = log.records[second ? 1 : 0];
    for (Eigen::Index c = 0; c < 5; ++c) {
      const Eigen::VectorXd x =
          (c < 2 ? samples.sensors.col(c) : samples.actuators.col(c - 2)).segment(period * N, N);
      // Rounding of sums of N terms.
      EXPECT_LT(std::abs(record.lines[3].Z(c, column) - dft_of(x, 7)),
                1e-13 * x.cwiseAbs().maxCoeff())
          << column << " " << c;
    }
  }
}

// An estimate refuses such a log; the reason is found in the rest of it.
TEST(HealthRecord, ARealizationWithoutRecordedExcitationHidesNoOther) {
  MemoryLog log = recorded_log();
  for (std::size_t run = 2; run < 4; ++run) log.excitation_periods.at(run).setZero();
  const HealthRecord record = read_health_record({&log}, {});
  EXPECT_EQ(record.realization, 0);
  EXPECT_EQ(record.lines.size(), 60U);
}

TEST(HealthRecord, IsTheSameFromTheReadingOfTheEstimate) {
  const MemoryLog log = recorded_log();
  const HealthRecord alone = read_health_record({&log}, {.threads = 1});
  const FrfEstimate estimate = estimate_plant_frf({&log});
  for (const int threads : {1, 2, 5}) {
    const FrfAndHealth both = estimate_plant_frf_and_health({&log}, {.threads = threads});
    expect_equal(both.health, alone);
    test::expect_same(both.frf, estimate);
  }
}

TEST(HealthRecord, HoldsAFewPeriodsOfTheOtherRealizations) {
  LoopExperiment x{.axes = 2, .realizations = 3, .periods = 9};
  const MemoryLog log = test::simulate_log(test::small_stage(), x);
  const HealthRecord record = read_health_record({&log}, {});
  EXPECT_EQ(record.periods, (std::vector<int>{9, 9}));
  ASSERT_EQ(record.others.size(), 2U);
  const auto most = static_cast<int>(kPeriodsOfOthers);
  EXPECT_EQ(record.others[1].realization, 2);
  EXPECT_EQ(record.others[1].periods, (std::vector<int>{most, most}));
  EXPECT_EQ(record.others[1].lines[0].Z.cols(), 2 * most);
}

TEST(HealthRecord, HoldsAllChannelsWhateverIsEstimated) {
  const MemoryLog log = recorded_log();
  const HealthRecord alone = read_health_record({&log}, {});
  expect_equal(estimate_plant_frf_and_health({&log}, {.outputs = {"z2"}}).health, alone);
  const FrfOptions lpm{.transient_periods = log.log_info.transient_periods,
                       .method = FrfMethod::lpm};
  expect_equal(estimate_plant_frf_and_health({&log}, lpm).health, alone);
}

// A glitch would be taken for a fault of its channel, or for a drift.
TEST(HealthRecord, PeriodsThatDifferFromTheOthersAreNoEvidence) {
  MemoryLog log = recorded_log();
  Eigen::MatrixXd& y = log.records[0].sensors;
  const Eigen::Index N = log.log_info.period_samples;
  const Eigen::Index second = (log.log_info.transient_periods + 1) * N;
  y(second + N / 2, 0) += 1e3 * y.cwiseAbs().maxCoeff();
  EXPECT_EQ(read_health_record({&log}, {}).periods, (std::vector<int>{4, 3}));
  const HealthRecord of_glitch = estimate_plant_frf_and_health({&log}).health;
  EXPECT_EQ(of_glitch.periods, (std::vector<int>{3, 3}));
  EXPECT_EQ(of_glitch.start.runs.size(), 2U);  // the second run has a marked period
  y.middleRows(second, N) += 10.0 * y.middleRows(second - N / 3, N);
  EXPECT_EQ(estimate_plant_frf_and_health({&log}).health.periods, (std::vector<int>{3, 3}));
}

// The transient of the start is what the evidence of the start is about.
TEST(HealthRecord, TheEvidenceOfTheStartStaysIfItsTransientCostsTheFirstPeriod) {
  MemoryLog log = recorded_log();
  const std::size_t before = estimate_plant_frf_and_health({&log}).health.start.runs.size();
  const Eigen::Index first = log.log_info.transient_periods * log.log_info.period_samples;
  for (LogSamples& record : log.records)
    for (Eigen::Index n = 0; n < log.log_info.period_samples; ++n)
      record.sensors.row(first + n).array() +=
          100.0 * std::exp(-8.0 * static_cast<double>(n) / log.log_info.period_samples) *
          std::cos(0.3 * static_cast<double>(n));
  const FrfAndHealth both = estimate_plant_frf_and_health({&log});
  EXPECT_EQ(both.frf.dropped_periods.size(), 5U);  // one is marked
  EXPECT_EQ(both.health.start.runs.size(), before);
}

}  // namespace stageid::test_health_record
