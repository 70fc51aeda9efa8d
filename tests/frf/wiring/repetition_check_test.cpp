#include "frf/wiring/timing_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frf/health/data_health.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_repetition_check {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;

MemoryLog log_of(const LoopExperiment& x) { return test::simulate_log(test::small_stage(), x); }

LoopExperiment experiment(int periods, double noise) {
  LoopExperiment x{.period_samples = 500, .realizations = 1, .periods = periods};
  x.lines = test::line_range(5, 179, 2);
  x.noise_factor = noise * Eigen::MatrixXcd::Identity(2, 2);
  return x;
}

std::vector<Finding> check_log(const MemoryLog& log) {
  return check_repetition(read_health_record({&log}, {}));
}

/// A period other than the measured one.
void declare(MemoryLog& log, int samples) {
  const auto old = static_cast<Eigen::Index>(log.log_info.period_samples);
  log.log_info.period_samples = samples;
  for (std::size_t r = 0; r < log.records.size(); ++r) {
    log.excitation_periods[r] =
        log.excitation_periods[r].replicate((samples + old - 1) / old, 1).topRows(samples).eval();
    const Eigen::Index rows = log.records[r].sensors.rows() / samples * samples;
    log.log_runs[r].samples = static_cast<std::uint64_t>(rows);
  }
}

TEST(Repetition, AWrongPeriodIsAFaultWithoutAnyStage) {
  for (const int samples : {250, 300, 375}) {
    MemoryLog log = log_of(experiment(5, 1e-3));
    declare(log, samples);
    const std::vector<Finding> found = check_health(read_health_record({&log}, {}), std::nullopt);
    ASSERT_FALSE(found.empty()) << samples;
    EXPECT_EQ(found[0].severity, Severity::fault) << samples;
    EXPECT_EQ(found[0].cause, Cause::aperiodic) << samples;
    EXPECT_THAT(found[0].remedy, HasSubstr("period_samples"));
  }
}

TEST(Repetition, PeriodsThatAreOneNoiseAreAFault) {
  MemoryLog log = log_of(experiment(4, 1e-3));
  test::ComplexNoise random(3);
  for (LogSamples& record : log.records)
    for (double& u : record.actuators.reshaped()) u = random.gaussian().real();
  EXPECT_EQ(check_log(log).size(), 1U);
}

TEST(Repetition, NoiseIsNoWrongPeriod) {
  for (const double noise : {0.0, 1e-3, 0.1, 0.2})
    for (const int periods : {1, 2, 3, 8})
      EXPECT_TRUE(check_log(log_of(experiment(periods, noise))).empty())
          << noise << ", " << periods << " periods";
}

// F above 1e16 is the clearest response.
TEST(DataHealth, WithoutNoiseNoSensorIsDead) {
  const MemoryLog log = log_of(experiment(4, 0.0));
  for (const Finding& finding : check_health(read_health_record({&log}, {}), std::nullopt))
    EXPECT_EQ(finding.severity, Severity::unchecked) << finding.what;
}

// An excitation added at the reference does not have an actuator's name.
TEST(Repetition, TheExcitationNeedNotBeAtTheActuators) {
  MemoryLog log = log_of(experiment(5, 1e-3));
  log.log_info.excitation.names = {"r1", "r2", "r3"};
  EXPECT_TRUE(check_log(log).empty());
  declare(log, 300);
  EXPECT_EQ(check_log(log).size(), 1U);
}

}  // namespace stageid::test_repetition_check
