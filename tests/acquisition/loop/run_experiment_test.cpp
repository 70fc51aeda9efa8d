#include "acquisition/loop/run_experiment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <thread>

#include "acquisition/files/file_error.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/acquisition/loop/run_experiment_fixture.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/file_size_limit.hpp"

namespace stageid::test_run_experiment {

using test::expect_error;
using testing::HasSubstr;

struct RunExperiment : test::RunExperimentTest {
  static LogSamples all_samples(const LogReader& reader, std::size_t run) {
    LogSamples samples;
    reader.read(run, 0, reader.runs()[run].samples, samples);
    return samples;
  }

  static bool same(const LogSamples& a, const LogSamples& b) {
    return a.actuators == b.actuators && a.sensors == b.sensors && (a.marked == b.marked).all();
  }
};

TEST_F(RunExperiment, LogsEveryRunOfThePlan) {
  const ExperimentResult result = measure_into("a.slog");
  EXPECT_EQ(result.end, ExperimentEnd::complete);
  EXPECT_EQ(result.runs_done, 4);
  EXPECT_EQ(result.health.cycles, 4 * kSamples);
  EXPECT_EQ(result.health.marked, 0U);

  const SlogReader reader(directory_ / "a.slog");
  EXPECT_EQ(reader.info().excitation.names, (std::vector<std::string>{"u3", "u1"}));
  EXPECT_EQ(reader.info().excitation.units, (std::vector<std::string>{"N", "N"}));
  const std::vector<RunId> runs = plan_.runs();
  ASSERT_EQ(reader.runs().size(), runs.size());
  for (std::size_t run = 0; run < runs.size(); ++run) {
    const LogRun& read = reader.runs()[run];
    EXPECT_TRUE(read.complete);
    EXPECT_EQ(read.samples, kSamples);
    EXPECT_EQ(read.realization, runs[run].realization);
    EXPECT_EQ(read.experiment, runs[run].experiment);
    EXPECT_EQ(read.started_utc.size(), 20U);
    EXPECT_EQ(reader.excitation(run), plan_.excitation(runs[run]));
    EXPECT_EQ(inner_->seeds()[run], run_seed(17, runs[run]));
  }
}

// The controller starts from rest in every run, so the recorded y gives the recorded u again.
TEST_F(RunExperiment, TheRecordIsControllerPlusExcitationOnTheRightActuators) {
  measure_into("a.slog");
  const SlogReader reader(directory_ / "a.slog");
  for (std::size_t run = 0; run < reader.runs().size(); ++run) {
    const LogSamples samples = all_samples(reader, run);
    const Eigen::MatrixXd excitation = plan_.excitation(plan_.runs()[run]);
    MotionController again(test::analytic_controller(inner_->info()));
    for (Eigen::Index n = 0; n < static_cast<Eigen::Index>(kSamples); ++n) {
      const Eigen::VectorXd y = samples.sensors.row(n);
      Eigen::VectorXd u(kActuators);
      again.update(y.data(), u.data());
      u[2] += excitation(n % test::kPlanPeriod, 0);
      u[0] += excitation(n % test::kPlanPeriod, 1);
      ASSERT_EQ(u, samples.actuators.row(n).transpose()) << "run " << run << ", row " << n;
    }
  }
}

TEST_F(RunExperiment, InterruptedAndResumedItGivesTheSameBits) {
  measure_into("whole.slog");
  std::atomic<bool> interrupt = false;
  ExperimentResult result;
  {
    SlogWriter log = create("parts.slog");
    // The second run is interrupted; the first is skipped as if it were complete already.
    inner_->raise = {{150, &interrupt}};
    result = measure(log, {.skip = {{0, 1}, {1, 0}, {1, 1}}});  // run (0, 0), flag ignored
    EXPECT_EQ(result.end, ExperimentEnd::complete);
    interrupt = false;
    result = measure(log, {.skip = {{0, 0}}, .interrupt = &interrupt, .ramp_s = 0.02});
    EXPECT_EQ(result.end, ExperimentEnd::interrupted);
    EXPECT_EQ(result.runs_done, 0);
    log.close(130, result.message.c_str());
    inner_->raise.clear();
  }
  std::vector<RunId> done;
  {
    const SlogReader reader(directory_ / "parts.slog");
    ASSERT_EQ(reader.runs().size(), 2U);
    EXPECT_FALSE(reader.runs()[1].complete);
    const LogSamples broken = all_samples(reader, 1);
    // Exchange 150 set the flag: its row is good, the next begins the stop, 20 rows of the ramp follow.
    EXPECT_EQ(reader.runs()[1].samples, 151U + 1 + 20);
    EXPECT_TRUE((broken.marked.head(151) == 0).all() && (broken.marked.tail(21) == 1).all());
    for (const LogRun& run : reader.runs()) {
      if (run.complete) done.push_back({run.realization, run.experiment});
    }
  }
  {
    SlogWriter log =
        SlogWriter::resume(directory_ / "parts.slog", experiment_log_info(plan_, stage_->info()));
    result = measure(log, {.skip = done});
    EXPECT_EQ(result.end, ExperimentEnd::complete);
    EXPECT_EQ(result.runs_done, 3);
    log.close(0, "done");
  }
  const SlogReader whole(directory_ / "whole.slog");
  const SlogReader parts(directory_ / "parts.slog");
  std::size_t compared = 0;
  for (std::size_t run = 0; run < parts.runs().size(); ++run) {
    if (!parts.runs()[run].complete) continue;
    EXPECT_TRUE(same(all_samples(parts, run), all_samples(whole, compared)));
    EXPECT_EQ(parts.excitation(run), whole.excitation(compared));
    ++compared;
  }
  EXPECT_EQ(compared, 4U);
}

TEST_F(RunExperiment, AnInterruptBeforeTheFirstRunMeasuresNothing) {
  const std::atomic<bool> interrupt = true;
  const ExperimentResult result = measure_into("a.slog", {.interrupt = &interrupt});
  EXPECT_EQ(result.end, ExperimentEnd::interrupted);
  EXPECT_TRUE(inner_->seeds().empty());
}

TEST_F(RunExperiment, APlantThatTripsEndsInAControlledStopWithItsReason) {
  std::atomic<bool> tripped = false;
  inner_->raise = {{150, &tripped}};
  const RunExperimentOptions options{
      .plant_tripped = &tripped, .plant_reason = [] { return "too hot"; }, .ramp_s = 0.02};
  const ExperimentResult result = measure_into("a.slog", options);
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_EQ(result.message, "too hot");
  EXPECT_EQ(inner_->stops(), 1);
  EXPECT_EQ(inner_->seeds().size(), 1U) << "no further run";
  const SlogReader reader(directory_ / "a.slog");
  // As for an interrupt: the row of that exchange is good, then follow the stop and its ramp.
  EXPECT_EQ(reader.runs()[0].samples, 151U + 1 + 20);
  const LogSamples samples = all_samples(reader, 0);
  EXPECT_TRUE((samples.marked.head(151) == 0).all() && (samples.marked.tail(21) == 1).all());
  EXPECT_EQ(measure_into("b.slog", options).end, ExperimentEnd::fault) << "before a run";
  EXPECT_EQ(inner_->seeds().size(), 1U);
}

TEST_F(RunExperiment, ALimitEndsInAControlledStopAndKeepsTheLog) {
  inner_->first_sensor = {{140, 1e9}};  // far off, so the controller commands more than 50 N
  const ExperimentResult result = measure_into("a.slog", {.ramp_s = 0.03});
  EXPECT_EQ(result.end, ExperimentEnd::limit);
  EXPECT_EQ(result.message, describe(stage_->violation(), stage_->info()));
  EXPECT_THAT(result.message, HasSubstr("50"));
  EXPECT_EQ(inner_->stops(), 1);
  EXPECT_EQ(inner_->seeds().size(), 1U) << "no further run";
  for (const double u : inner_->sent()) ASSERT_LE(std::abs(u), 50.0);

  const SlogReader reader(directory_ / "a.slog");
  ASSERT_EQ(reader.runs().size(), 1U);
  EXPECT_FALSE(reader.runs()[0].complete);
  EXPECT_EQ(reader.runs()[0].samples, 142U + 30);
  const LogSamples samples = all_samples(reader, 0);
  EXPECT_TRUE((samples.marked.head(141) == 0).all());
  EXPECT_TRUE((samples.marked.tail(31) == 1).all());
}

TEST_F(RunExperiment, AFaultAndTooManyMissesAreTold) {
  inner_->outcomes = {{10, Outcome::fault}};
  SlogWriter log = create("a.slog");
  ExperimentResult result = measure(log);
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_THAT(result.message, HasSubstr("fault"));

  inner_->outcomes.clear();
  for (std::uint64_t n = 10; n < 20; ++n) inner_->outcomes[n] = Outcome::stale;
  result = measure(log);
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_THAT(result.message, HasSubstr("stale"));
  EXPECT_EQ(result.runs_done, 0);
  EXPECT_GT(result.health.missing, 0U);
}

TEST_F(RunExperiment, AFullDiskEndsInAControlledStop) {
  plan_ =
      test::small_plan(2, 900);  // 90 000 rows of 48 bytes per run: more than the ring's capacity
  const auto file = directory_ / "a.slog";
  SlogWriter log = create("a.slog");
  ExperimentResult result;
  {
    const test::FileSizeLimit limit(log.bytes() + 300'000);
    result = measure(log);
  }
  EXPECT_EQ(result.end, ExperimentEnd::log_failed);
  EXPECT_THAT(result.message, HasSubstr("are kept"));
  EXPECT_EQ(inner_->stops(), 1);
  const auto reader = open_log(file, false);
  ASSERT_EQ(reader->runs().size(), 1U);
  EXPECT_FALSE(reader->runs()[0].complete);
  EXPECT_GE(reader->runs()[0].samples, 4096U);
  EXPECT_EQ(reader->runs()[0].samples, log.acknowledged_rows());
}

TEST_F(RunExperiment, ALogThatIsRemovedEndsInAControlledStop) {
  SlogWriter log = create("a.slog");
  std::filesystem::remove(directory_ / "a.slog");
  const ExperimentResult result = measure(log);
  EXPECT_EQ(result.end, ExperimentEnd::log_failed);
  EXPECT_THAT(result.message, HasSubstr("its directory was removed"));
  EXPECT_EQ(result.runs_done, 0);
}

TEST_F(RunExperiment, AStageThatDoesNotStartIsAFaultAndTheLogIsKept) {
  inner_->refuse_run = 2;
  const ExperimentResult result = measure_into("a.slog");
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_THAT(result.message, HasSubstr("refuses"));
  EXPECT_EQ(result.runs_done, 2);
  const SlogReader reader(directory_ / "a.slog");
  ASSERT_EQ(reader.runs().size(), 2U);
  EXPECT_TRUE(reader.runs()[0].complete && reader.runs()[1].complete);
}

TEST_F(RunExperiment, AnInterruptWhileAStageDoesNotStartIsAnInterrupt) {
  std::atomic<bool> interrupt = false;
  inner_->refuse_run = 1;
  inner_->raise_at_refusal = &interrupt;
  const ExperimentResult result = measure_into("a.slog", {.interrupt = &interrupt});
  EXPECT_EQ(result.end, ExperimentEnd::interrupted);
  EXPECT_EQ(result.runs_done, 1);
}

TEST_F(RunExperiment, ReportsProgressFromTheCallingThread) {
  plan_ = test::small_plan(1, 9);
  std::vector<ExperimentProgress> seen;
  const auto caller = std::this_thread::get_id();
  measure_into("a.slog", {.skip = {{0, 0}}, .progress = [&](const ExperimentProgress& progress) {
                            EXPECT_TRUE(std::this_thread::get_id() == caller);
                            seen.push_back(progress);
                          }});
  ASSERT_FALSE(seen.empty());
  const ExperimentProgress& last = seen.back();
  EXPECT_EQ(last.run, (RunId{0, 1}));
  EXPECT_EQ(last.runs_total, 1);
  EXPECT_EQ(last.runs_done, 1);
  EXPECT_DOUBLE_EQ(last.seconds_total, 1.0);
  EXPECT_DOUBLE_EQ(last.seconds_done, 1.0);
}

TEST_F(RunExperiment, AnExceptionOfTheProgressFunctionStopsTheStage) {
  RunExperimentOptions options;
  options.progress = [](const ExperimentProgress&) { throw std::runtime_error("enough"); };
  EXPECT_EQ(test::error_message<std::runtime_error>([&] { measure_into("a.slog", options); }),
            "enough");
  EXPECT_EQ(inner_->stops(), static_cast<int>(inner_->seeds().size()));
}

TEST_F(RunExperiment, RefusesAPlanThatDoesNotFit) {
  StageInfo other = inner_->info();
  other.sample_rate_hz = 2000.0;
  EXPECT_THROW(experiment_log_info(plan_, other), std::invalid_argument);
  other = inner_->info();
  other.actuators[2].name = "u9";
  expect_error<std::invalid_argument>([&] { experiment_log_info(plan_, other); }, "", "'u3'");
  other = inner_->info();
  other.maximum_rate_hz = 500.0;
  EXPECT_THROW(experiment_log_info(plan_, other), std::invalid_argument);

  LogInfo info = experiment_log_info(plan_, stage_->info());
  info.period_samples *= 2;
  SlogWriter log = SlogWriter::create(directory_ / "a.slog", info);
  EXPECT_THROW(measure(log), std::invalid_argument);
  EXPECT_TRUE(inner_->seeds().empty());
}

// Values computed with the reference splitmix64 in Python.
TEST(RunSeed, IsTheDocumentedMix) {
  EXPECT_EQ(run_seed(0, {0, 0}), 0x238275BC38FCBE91U);
  EXPECT_EQ(run_seed(17, {2, 12}), 0xFC6CCF55DC557BBU);
  std::set<std::uint64_t> seeds;
  for (std::uint64_t plan : {0U, 1U}) {
    for (int r = 0; r < 20; ++r) {
      for (int e = 0; e < 20; ++e) seeds.insert(run_seed(plan, {r, e}));
    }
  }
  EXPECT_EQ(seeds.size(), 800U);
}

// Called before every realization, with all previous ones in the log.
TEST_F(RunExperiment, EndsCompleteBetweenRealizationsWhenItIsEnough) {
  plan_ = test::small_plan(3);
  std::vector<std::size_t> seen;
  RunExperimentOptions options;
  options.enough = [&]() -> std::string {
    seen.push_back(SlogReader(directory_ / "enough.slog", false).runs().size());  // not closed yet
    return seen.size() == 3 ? "good enough" : "";
  };
  const ExperimentResult result = measure_into("enough.slog", options);
  EXPECT_EQ(result.end, ExperimentEnd::complete);
  EXPECT_EQ(result.message, "good enough; 4 runs measured");
  EXPECT_EQ(seen, (std::vector<std::size_t>{0, 2, 4}));
  EXPECT_EQ(SlogReader(directory_ / "enough.slog").runs().size(), 4U);
}

TEST_F(RunExperiment, AHeldStageIsStartedAndStoppedOnce) {
  const ExperimentResult result = measure_into("held.slog", {.between_runs = BetweenRuns::hold});
  EXPECT_EQ(result.end, ExperimentEnd::complete);
  EXPECT_EQ(result.runs_done, 4);
  EXPECT_EQ(inner_->seeds().size(), 1U);
  EXPECT_EQ(inner_->stops(), 1);
  const SlogReader reader(directory_ / "held.slog");
  ASSERT_EQ(reader.runs().size(), 4U);
  for (const LogRun& run : reader.runs()) {
    EXPECT_TRUE(run.complete);
    EXPECT_EQ(static_cast<std::uint64_t>(run.samples), kSamples);
    EXPECT_EQ(run.health.marked, 0U);
  }
}

// Deciding whether it is enough may take long: the loop must not wait for it.
TEST_F(RunExperiment, AHeldStageIsControlledWhileTheResultIsEvaluated) {
  use_wall_clock();
  RunExperimentOptions options;
  options.between_runs = BetweenRuns::hold;
  std::atomic<bool> cycled = false;
  inner_->raise[100'000] = &cycled;  // far beyond the 1000 exchanges of the first realization
  int asked = 0;
  options.enough = [&]() -> std::string {
    if (asked++ == 0) return "";  // before the loop is closed
    for (int wait = 0; wait < 1000 && !cycled; ++wait)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return "";
  };
  EXPECT_EQ(measure_into("evaluated.slog", options).end, ExperimentEnd::complete);
  EXPECT_EQ(inner_->stops(), 1);
  EXPECT_EQ(asked, 2);
  EXPECT_TRUE(cycled);
}

TEST_F(RunExperiment, AnInterruptWhenARunEndsStopsAHeldStage) {
  // The first run ends after its leading ramp (100), its samples (300) and its landing (100).
  for (std::uint64_t exchange = 495; exchange < 505; ++exchange) {
    use(std::make_unique<test::AnalyticStage>(kActuators, kSensors), {});
    std::atomic<bool> interrupt = false;
    inner_->raise = {{exchange, &interrupt}};
    const ExperimentResult result =
        measure_into(std::to_string(exchange) + ".slog",
                     {.interrupt = &interrupt, .between_runs = BetweenRuns::hold});
    EXPECT_EQ(result.end, ExperimentEnd::interrupted) << exchange;
    EXPECT_EQ(inner_->stops(), 1) << exchange;
  }
}

TEST_F(RunExperiment, ALimitBetweenRunsStopsAHeldStageAndKeepsTheRun) {
  StageLimits limits;
  limits.position_window_m = Eigen::VectorXd::Constant(kSensors, 0.5);
  limits.hard_window_m = Eigen::VectorXd::Constant(kSensors, 2.0);
  use_wall_clock(limits);
  // After the leading ramp (100), the run (300) and its landing (100).
  for (std::uint64_t n = 510; n < 2000; ++n) inner_->first_sensor[n] = 1.0;
  RunExperimentOptions options;
  options.between_runs = BetweenRuns::hold;
  int asked = 0;
  options.enough = [&]() -> std::string {
    if (asked++ > 0) std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return "";
  };
  const ExperimentResult result = measure_into("between.slog", options);
  EXPECT_EQ(result.end, ExperimentEnd::limit);
  EXPECT_THAT(result.message, HasSubstr("sensor y1: |y| is 1 m, limit 0.5 m"));
  EXPECT_EQ(inner_->stops(), 1);
  EXPECT_GE(result.runs_done, 1);
}

}  // namespace stageid::test_run_experiment
