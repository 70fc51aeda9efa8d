#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/files/file_error.hpp"
#include "frf/plant/plant_frf.hpp"
#include "frf/runs/health_record.hpp"
#include "tests/support/models/expect_same_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_left_out_realization {

using test::LoopExperiment;
using test::MemoryLog;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kExperiments = 2;

/// Three realizations of two runs; the marked runs have no usable period.
MemoryLog log_with_marked_runs(const std::vector<std::size_t>& marked_runs) {
  LoopExperiment x{.axes = kExperiments, .realizations = 3, .periods = 4};
  x.lines = test::line_range(1, 119, 2);
  x.noise_factor = 0.1 * Eigen::MatrixXcd::Identity(2, 2);
  MemoryLog log = test::simulate_log(test::small_stage(), x);
  for (const std::size_t run : marked_runs) log.records[run].marked.setOnes();
  return log;
}

void expect_as_without(const MemoryLog& log, int left_out, const FrfOptions& options) {
  FrfOptions others = options;
  for (int m = 0; m < 3; ++m)
    if (m != left_out) others.realizations.push_back(m);
  const FrfEstimate want = estimate_plant_frf({&log}, others);
  for (const int threads : {1, 3}) {
    FrfOptions all = options;
    all.threads = threads;
    const FrfEstimate frf = estimate_plant_frf({&log}, all);
    EXPECT_EQ(frf.realizations, 2);
    EXPECT_EQ(frf.response, want.response);
    EXPECT_EQ(frf.noise_variance, want.noise_variance);
    EXPECT_EQ(frf.total_variance, want.total_variance);
    EXPECT_EQ(frf.noise_dof, want.noise_dof);
    EXPECT_EQ(frf.excluded_power, want.excluded_power);
    ASSERT_EQ(frf.left_out_realizations.size(), 1U);
    EXPECT_EQ(frf.left_out_realizations[0].realization, left_out);
    EXPECT_THAT(frf.left_out_realizations[0].reason, HasSubstr("has a marked sample"));
  }
}

TEST(LeftOutRealization, TheOthersGiveWhatTheyGiveAlone) {
  expect_as_without(log_with_marked_runs({1}), 0, {});
  expect_as_without(log_with_marked_runs({2 * kExperiments}), 2, {});
  expect_as_without(log_with_marked_runs({2, 3}), 1, {.method = FrfMethod::lpm});
}

TEST(LeftOutRealization, ItsDroppedPeriodsAreTold) {
  const MemoryLog log = log_with_marked_runs({3});
  const FrfEstimate frf = estimate_plant_frf({&log}, {});
  ASSERT_EQ(frf.dropped_periods.size(), 4U);
  for (const DroppedPeriod& dropped : frf.dropped_periods) {
    EXPECT_EQ(dropped.realization, 1);
    EXPECT_EQ(dropped.experiment, 1);
    EXPECT_EQ(dropped.reason, "a marked sample");
  }
}

TEST(LeftOutRealization, AMissingOrIncompleteRunIsTold) {
  MemoryLog log = log_with_marked_runs({});
  log.log_runs[1].complete = false;
  log.log_runs[4].complete = false;
  log.log_runs[5].complete = false;
  const FrfEstimate frf = estimate_plant_frf({&log}, {});
  EXPECT_EQ(frf.realizations, 1);
  EXPECT_EQ(frf.total_variance.size(), 0);
  ASSERT_EQ(frf.left_out_realizations.size(), 2U);
  EXPECT_EQ(frf.left_out_realizations[0].realization, 0);
  EXPECT_EQ(frf.left_out_realizations[0].reason,
            "memory.slog: no complete run of experiment 2 (counted from 1)");
  EXPECT_EQ(frf.left_out_realizations[1].realization, 2);
  EXPECT_THAT(frf.left_out_realizations[1].reason, HasSubstr("experiment 1, 2 "));
  EXPECT_EQ(estimate_plant_frf({&log}, {.realizations = {1}}).left_out_realizations.size(), 0U);
  // One is missing in the log, another one has a marked record; ascending.
  MemoryLog both = log_with_marked_runs({1});
  both.log_runs.pop_back();
  const FrfEstimate other = estimate_plant_frf({&both}, {});
  ASSERT_EQ(other.left_out_realizations.size(), 2U);
  EXPECT_THAT(other.left_out_realizations[0].reason, HasSubstr("marked sample"));
  EXPECT_THAT(other.left_out_realizations[1].reason, HasSubstr("no complete run of experiment 2"));
}

// The health checks use the first realization that has all its runs.
TEST(LeftOutRealization, HealthLooksAtTheNextOne) {
  const MemoryLog log = log_with_marked_runs({1});
  const HealthRecord want = read_health_record({&log}, {.realizations = {1}});
  for (const int threads : {1, 3}) {
    const HealthRecord alone = read_health_record({&log}, {.threads = threads});
    const HealthRecord both = estimate_plant_frf_and_health({&log}, {.threads = threads}).health;
    for (const HealthRecord& record : {alone, both}) {
      EXPECT_EQ(record.realization, 1);
      test::expect_same(record, want);
      // Two of three realizations' four runs and the clean one of the first.
      EXPECT_EQ(record.scan[0].samples(), 5 * 4 * log.log_info.period_samples);
    }
  }
}

TEST(LeftOutRealization, OneAtLeastIsNeeded) {
  const MemoryLog log = log_with_marked_runs({1, 2, 4, 5});
  const auto wanted = AllOf(HasSubstr("/runs/0001"), HasSubstr("every realization has such a run"));
  EXPECT_THAT(test::error_message<FormatError>([&] { estimate_plant_frf({&log}, {}); }), wanted);
  EXPECT_THAT(test::error_message<FormatError>([&] { read_health_record({&log}, {}); }), wanted);
}

}  // namespace stageid::test_left_out_realization
