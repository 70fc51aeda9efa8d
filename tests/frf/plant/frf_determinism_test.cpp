#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid {
namespace test_frf_determinism {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;
using testing::Not;

MemoryLog noisy_log() {
  LoopExperiment x{.realizations = 3, .periods = 4, .scheme = test::AxisScheme::orthogonal};
  for (int line = 1; line < 120; line += 2) x.lines.push_back(line);
  std::sort(x.lines.begin(), x.lines.end());
  x.lines.erase(std::unique(x.lines.begin(), x.lines.end()), x.lines.end());
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
    const FrfEstimate many = estimate(threads);
    EXPECT_EQ(one.response, many.response);
    EXPECT_EQ(one.noise_variance, many.noise_variance);
    EXPECT_EQ(one.total_variance, many.total_variance);
    EXPECT_EQ(one.covariance, many.covariance);
    EXPECT_EQ(one.residual_covariance_re, many.residual_covariance_re);
    EXPECT_EQ(one.input_factor, many.input_factor);
    EXPECT_EQ(one.residual_covariance_im, many.residual_covariance_im);
    EXPECT_EQ(one.input_condition, many.input_condition);
    EXPECT_EQ(one.provenance_json, many.provenance_json);
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
  const FrfEstimate a = estimate_plant_frf({&whole});
  const FrfEstimate b = estimate_plant_frf({&resumed});
  EXPECT_EQ(a.response, b.response);
  EXPECT_EQ(a.noise_variance, b.noise_variance);
  EXPECT_EQ(a.provenance_json, b.provenance_json);
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

}  // namespace test_frf_determinism
}  // namespace stageid
