// Output of run_experiment() other than samples: events, observers, timing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "tests/acquisition/loop/run_experiment_fixture.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_run_experiment_events {

using testing::HasSubstr;

/// Counts the calls that it receives.
struct Counter final : RunObserver {
  void begin_run(const LogRun&) noexcept override { ++begun; }
  void rows(std::span<const double> rows, std::size_t) noexcept override { words += rows.size(); }
  void end_run(const LogRun& run) noexcept override { complete += run.complete ? 1 : 0; }
  int begun = 0;
  int complete = 0;
  std::size_t words = 0;
};

struct RunExperimentEvents : test::RunExperimentTest {
  RunExperimentEvents() { plan_ = test::small_plan(2, 2, {{"u1", 1.0, {}}}); }

  ExperimentResult measure(RunExperimentOptions options) {
    options.events = &events_;
    return measure_into("a.slog", options);
  }

  /// The events with that name, as text.
  std::vector<std::string> told(const std::string& event) const {
    std::vector<std::string> found;
    for (const std::string& line : events_.latest(100))
      if (line.find("\"event\":\"" + event + "\"") != std::string::npos) found.push_back(line);
    return found;
  }

  std::filesystem::path log_ = directory_ / "a.slog";
  EventLog events_{event_log_of(log_)};
};

TEST_F(RunExperimentEvents, RunsAndMissesAreTold) {
  inner_->outcomes = {{20, Outcome::stale}, {21, Outcome::stale}};
  measure({});
  EXPECT_EQ(told("run_begin").size(), 2U);
  EXPECT_EQ(told("run_end").size(), 2U);
  const auto misses = told("miss");
  ASSERT_EQ(misses.size(), 2U);  // the same script in every run
  EXPECT_THAT(misses[1], HasSubstr(R"("realization":1,"experiment":0,"cycle":21,"cycles":2)"));
  EXPECT_TRUE(told("stop").empty());
}

TEST_F(RunExperimentEvents, AStopIsToldWithItsReasonAndCycle) {
  inner_->first_sensor = {{140, 1e9}};
  measure({});
  const auto stops = told("stop");
  ASSERT_EQ(stops.size(), 1U);
  EXPECT_THAT(stops[0], HasSubstr(R"("cycle":141,"reason":"limit")"));
}

TEST_F(RunExperimentEvents, ATripOfThePlantIsToldAsSuch) {
  std::atomic<bool> tripped = false;
  inner_->raise = {{150, &tripped}};
  measure({.plant_tripped = &tripped, .plant_reason = [] { return std::string("too hot"); }});
  const auto stops = told("stop");
  ASSERT_EQ(stops.size(), 1U);
  EXPECT_THAT(stops[0], HasSubstr(R"("reason":"plant")"));
}

TEST_F(RunExperimentEvents, ObserversSeeEveryRowOfEveryRun) {
  Counter counter;
  measure({.observers = {&counter}});
  EXPECT_EQ(counter.begun, 2);
  EXPECT_EQ(counter.complete, 2);
  EXPECT_EQ(counter.words, 2 * kSamples * (kActuators + kSensors + 1));
}

TEST_F(RunExperimentEvents, TimingIsMeasuredAgainstTheWallClockOnlyAndKeptInTheLog) {
  EXPECT_TRUE(measure({}).timing.empty());
  std::filesystem::remove(log_);

  use_wall_clock();
  inner_->outcomes = {{50, Outcome::late}};
  inner_->lateness_ns = 2'500'000;  // two and a half periods
  ExperimentProgress last;
  const ExperimentResult result =
      measure({.progress = [&](const ExperimentProgress& p) { last = p; }});
  EXPECT_EQ(result.timing.lateness.total(), 2 * kSamples);
  EXPECT_EQ(result.timing.execution.total(), 2 * kSamples);
  EXPECT_EQ(result.timing.skipped, 2U * 2);
  EXPECT_EQ(result.timing.lateness.count(TimingHistogram::bin_of(2'500'000)), 2U);
  EXPECT_EQ(last.timing.lateness.total(), kSamples);

  RunTiming logged;
  const SlogReader reader(log_);
  for (const LogRun& run : reader.runs()) logged += run.timing;
  EXPECT_EQ(logged, result.timing);
}

TEST_F(RunExperimentEvents, RealTimeThatIsRequiredAndNotThereEndsBeforeTheFirstRun) {
  use_wall_clock();
  RunExperimentOptions options;
  options.real_time = {RealTimePolicy::require, 80, -1, false};
  // Refused by the same rules as in an earlier query: a kernel without PREEMPT_RT, or missing permissions.
  const auto query = [&] { missing_for_real_time(options.real_time); };
  if (test::error_message<StageError>(query) == "no error")
    GTEST_SKIP() << "this machine has all that is required";
  EXPECT_THROW(measure(options), StageError);
  EXPECT_TRUE(inner_->seeds().empty());
}

TEST_F(RunExperimentEvents, HoldingIsToldAsNotRecorded) {
  use_wall_clock();
  measure({.between_runs = BetweenRuns::hold});
  EXPECT_EQ(told("run_end").size(), 2U);
  const std::vector<std::string> holds = told("hold");
  ASSERT_EQ(holds.size(), 1U);  // between two runs
  EXPECT_THAT(holds[0], HasSubstr("\"realization\":1"));
  EXPECT_THAT(holds[0], testing::Not(HasSubstr("\"cycles_not_recorded\":0}")));
}

}  // namespace stageid::test_run_experiment_events
