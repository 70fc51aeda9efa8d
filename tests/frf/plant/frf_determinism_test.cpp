#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/models/expect_same_frf.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_frf_determinism {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;
using testing::Not;

MemoryLog noisy_log() {
  LoopExperiment x{.realizations = 3, .periods = 4, .scheme = test::AxisScheme::orthogonal};
  x.lines = test::line_range(1, 119, 2);
  x.noise_factor = 0.1 * Eigen::MatrixXcd::Identity(2, 2);
  return test::simulate_log(test::small_stage(), x);
}

TEST(FrfDeterminism, AnyNumberOfThreadsGivesTheSameBits) {
  const MemoryLog log = noisy_log();
  const auto estimate = [&log](int threads) {
    return estimate_plant_frf({&log}, {.covariance = CovarianceKind::full, .threads = threads});
  };
  const FrfEstimate one = estimate(1);
  for (const int threads : {2, 3, 7, 0}) {
    SCOPED_TRACE(threads);
    test::expect_same(one, estimate(threads));
  }
}

TEST(FrfDeterminism, AResumedExperimentIsTheUninterruptedOne) {
  const MemoryLog whole = noisy_log();
  MemoryLog resumed;
  resumed.log_info = whole.log_info;
  for (std::size_t run = 0; run < whole.log_runs.size(); ++run) {
    const LogRun& id = whole.log_runs[run];
    if (run == 4) {  // killed here: an incomplete run remains in the log
      LogSamples stub = whole.records[run];
      stub.sensors.setZero();
      resumed.append(id.realization, id.experiment, whole.excitation_periods[run], stub);
      resumed.log_runs.back().complete = false;
      resumed.log_runs.back().samples = 111;
    }
    resumed.append(id.realization, id.experiment, whole.excitation_periods[run],
                   whole.records[run]);
    resumed.log_runs.back().started_utc = "2031-01-01T00:00:00Z";
  }
  test::expect_same(estimate_plant_frf({&whole}), estimate_plant_frf({&resumed}));
}

TEST(FrfDeterminism, ProvenanceNamesFileHashAndOptionsButNoPlaceOrThread) {
  MemoryLog log = noisy_log();
  log.file = "/some/where/run.slog";
  const std::string before = estimate_plant_frf({&log}, {.threads = 2}).provenance_json;
  EXPECT_THAT(before, HasSubstr("\"file\":\"run.slog\""));
  EXPECT_THAT(before, HasSubstr("\"transient_periods\":1"));
  EXPECT_THAT(before, HasSubstr("\"inputs\":[\"a1\",\"a2\",\"a3\"]"));
  EXPECT_THAT(before, Not(HasSubstr("/some/where")));
  EXPECT_THAT(before, Not(HasSubstr("threads")));

  log.records[5].sensors(251, 1) += 1e-12;  // a used sample
  EXPECT_NE(before, estimate_plant_frf({&log}).provenance_json);
  log.records[5].sensors(251, 1) = noisy_log().records[5].sensors(251, 1);
  log.records[5].sensors(17, 1) += 1.0;  // a sample of the transient is not used
  EXPECT_EQ(before, estimate_plant_frf({&log}).provenance_json);
}

}  // namespace stageid::test_frf_determinism
