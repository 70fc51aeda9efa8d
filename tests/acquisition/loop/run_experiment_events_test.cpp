// Output of run_experiment() other than samples: events, observers, timing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "tests/acquisition/loop/small_plan.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/analytic_stage.hpp"

namespace stageid::test_run_experiment_events {

using test::AnalyticStage;
using testing::HasSubstr;

constexpr std::uint64_t kSamples = 3 * test::kPlanPeriod;

/// Counts the calls that it receives.
struct Counter final : RunObserver {
  void begin_run(const LogRun&) noexcept override { ++begun; }
  void rows(std::span<const double> rows, std::size_t) noexcept override { words += rows.size(); }
  void end_run(const LogRun& run) noexcept override { complete += run.complete ? 1 : 0; }
  int begun = 0;
  int complete = 0;
  std::size_t words = 0;
};

struct RunExperimentEvents : testing::Test {
  void make_stage(Clock clock = Clock::virtual_time) {
    auto stage = std::make_unique<AnalyticStage>(2, 1, 1000.0, clock);
    stage->spoil_missing = false;
    inner_ = stage.get();
    StageLimits limits;
    limits.actuator_n = Eigen::VectorXd::Constant(2, 50.0);
    stage_ = std::make_unique<LimitedStage>(std::move(stage), limits);
    controller_ = std::make_unique<MotionController>(test::analytic_controller(inner_->info()));
  }

  ExperimentResult measure(RunExperimentOptions options) {
    options.events = &events_;
    SlogWriter log = SlogWriter::create(log_, experiment_log_info(plan_, stage_->info()));
    const ExperimentResult result = run_experiment(plan_, *stage_, *controller_, log, options);
    log.close(0, "");
    return result;
  }

  /// The events with that name, as text.
  std::vector<std::string> told(const std::string& event) const {
    std::vector<std::string> found;
    for (const std::string& line : events_.latest(100))
      if (line.find("\"event\":\"" + event + "\"") != std::string::npos) found.push_back(line);
    return found;
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path log_ = directory_ / "a.slog";
  EventLog events_{event_log_of(log_)};
  ExperimentPlan plan_ = test::small_plan(2, 2, {{"u1", 1.0, {}}});
  AnalyticStage* inner_ = nullptr;
  std::unique_ptr<LimitedStage> stage_;
  std::unique_ptr<MotionController> controller_;
};

TEST_F(RunExperimentEvents, RunsAndMissesAreTold) {
  make_stage();
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
  make_stage();
  inner_->first_sensor = {{140, 1e9}};
  measure({});
  const auto stops = told("stop");
  ASSERT_EQ(stops.size(), 1U);
  EXPECT_THAT(stops[0], HasSubstr(R"("cycle":141,"reason":"limit")"));
}

TEST_F(RunExperimentEvents, ATripOfThePlantIsToldAsSuch) {
  make_stage();
  std::atomic<bool> tripped = false;
  inner_->raise = {{150, &tripped}};
  measure({.plant_tripped = &tripped, .plant_reason = [] { return std::string("too hot"); }});
  const auto stops = told("stop");
  ASSERT_EQ(stops.size(), 1U);
  EXPECT_THAT(stops[0], HasSubstr(R"("reason":"plant")"));
}

TEST_F(RunExperimentEvents, ObserversSeeEveryRowOfEveryRun) {
  make_stage();
  Counter counter;
  measure({.observers = {&counter}});
  EXPECT_EQ(counter.begun, 2);
  EXPECT_EQ(counter.complete, 2);
  EXPECT_EQ(counter.words, 2 * kSamples * 4);
}

TEST_F(RunExperimentEvents, TimingIsMeasuredAgainstTheWallClockOnlyAndKeptInTheLog) {
  make_stage();
  EXPECT_TRUE(measure({}).timing.empty());
  std::filesystem::remove(log_);

  make_stage(Clock::wall);
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
  make_stage(Clock::wall);
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
  make_stage(Clock::wall);
  measure({.between_runs = BetweenRuns::hold});
  EXPECT_EQ(told("run_end").size(), 2U);
  const std::vector<std::string> holds = told("hold");
  ASSERT_EQ(holds.size(), 1U);  // between two runs
  EXPECT_THAT(holds[0], HasSubstr("\"realization\":1"));
  EXPECT_THAT(holds[0], testing::Not(HasSubstr("\"cycles_not_recorded\":0}")));
}

}  // namespace stageid::test_run_experiment_events
