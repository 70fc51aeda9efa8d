// Resident experiments write the same log as the loop of the host, and keep their data if something fails.

#include "acquisition/loop/run_resident.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "acquisition/slog/slog_reader.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "tests/acquisition/loop/playing_stage.hpp"
#include "tests/acquisition/loop/small_plan.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_run_resident {

using testing::HasSubstr;

constexpr int kActuators = 3;
constexpr int kSensors = 2;
constexpr std::uint64_t kSamples = 300;

struct RunResident : testing::Test {
  ExperimentResult measure(const RunExperimentOptions& options = {}) {
    SlogWriter log = SlogWriter::create(file_, experiment_log_info(plan_, stage_.info()));
    const ExperimentResult result = run_resident_experiment(plan_, stage_, log, options);
    log.close(0, "done");
    return result;
  }

  std::vector<std::uint64_t> samples_of_runs() const {
    std::vector<std::uint64_t> samples;
    const SlogReader reader(file_);
    for (const LogRun& run : reader.runs()) samples.push_back(run.samples);
    return samples;
  }

  bool complete(std::size_t run) const { return SlogReader(file_).runs().at(run).complete; }

  test::TemporaryDirectory directory_;
  std::filesystem::path file_ = directory_ / "a.slog";
  ExperimentPlan plan_ = test::small_plan();
  test::PlayingStage stage_{kActuators, kSensors};
};

TEST_F(RunResident, LeavesTheLogOfALoopOnThisSide) {
  EXPECT_EQ(measure().runs_done, 4);
  const std::filesystem::path other = directory_ / "b.slog";
  {
    auto inner = std::make_unique<test::AnalyticStage>(kActuators, kSensors);
    inner->noise = 1e-3;
    MotionController controller(test::analytic_controller(inner->info()));
    LimitedStage limited(std::move(inner), {});
    SlogWriter log = SlogWriter::create(other, experiment_log_info(plan_, limited.info()));
    EXPECT_EQ(run_experiment(plan_, limited, controller, log).runs_done, 4);
    log.close(0, "done");
  }
  const SlogReader played(file_);
  const SlogReader streamed(other);
  ASSERT_EQ(played.runs().size(), streamed.runs().size());
  for (std::size_t run = 0; run < 4; ++run) {
    EXPECT_TRUE(played.runs()[run].complete);
    EXPECT_EQ(played.runs()[run].realization, streamed.runs()[run].realization);
    EXPECT_EQ(played.runs()[run].experiment, streamed.runs()[run].experiment);
    EXPECT_EQ(played.excitation(run), streamed.excitation(run));
    LogSamples a;
    LogSamples b;
    played.read(run, 0, kSamples, a);
    streamed.read(run, 0, kSamples, b);
    EXPECT_EQ(a.actuators, b.actuators) << run;
    EXPECT_EQ(a.sensors, b.sensors) << run;
    EXPECT_TRUE((a.marked == 0).all());
  }
}

TEST_F(RunResident, SkipsWhatIsThere) {
  const ExperimentResult result = measure({.skip = {{0, 0}, {1, 1}}});
  EXPECT_EQ(result.runs_done, 2);
  ASSERT_EQ(stage_.triggers.size(), 2U);
  EXPECT_EQ(stage_.triggers[0].run_seed, run_seed(17, {0, 1}));
}

TEST_F(RunResident, OddOutcomesOfTheTraceAreMarked) {
  stage_.odd_outcome = Outcome::late;
  const ExperimentResult result = measure();
  EXPECT_EQ(result.health.late, 4U);
  EXPECT_EQ(result.health.marked, 4U);
  EXPECT_EQ(result.health.missing, 0U);
  LogSamples samples;
  SlogReader(file_).read(0, 0, kSamples, samples);
  EXPECT_NE(samples.marked[7], 0);
  EXPECT_EQ((samples.marked != 0).count(), 1);
}

TEST_F(RunResident, ALimitOfTheStageEndsItWithWhatWasRecorded) {
  stage_.fails_at = 120;
  stage_.failure = Outcome::limit;
  const ExperimentResult result = measure();
  EXPECT_EQ(result.end, ExperimentEnd::limit);
  EXPECT_THAT(result.message, HasSubstr("the stage says no"));
  EXPECT_THAT(samples_of_runs(), testing::ElementsAre(120U));
  EXPECT_FALSE(complete(0));
  EXPECT_GE(stage_.stops, 1);
}

TEST_F(RunResident, AFaultOfTheStageIsOne) {
  stage_.fails_at = 120;
  EXPECT_EQ(measure().end, ExperimentEnd::fault);
}

TEST_F(RunResident, AnInterruptStopsTheStageAndKeepsTheRest) {
  std::atomic<bool> interrupt = false;
  stage_.polls = 3;
  stage_.at_poll = [&] { interrupt = stage_.triggers.size() == 2; };
  const ExperimentResult result = measure({.interrupt = &interrupt});
  EXPECT_EQ(result.end, ExperimentEnd::interrupted);
  EXPECT_EQ(result.runs_done, 1);
  EXPECT_TRUE(complete(0));
  EXPECT_FALSE(complete(1));
  EXPECT_GE(stage_.stops, 1);
}

TEST_F(RunResident, ThePlantEndsItAndSaysWhy) {
  std::atomic<bool> tripped = false;
  stage_.polls = 3;
  stage_.at_poll = [&] { tripped = true; };
  const ExperimentResult result =
      measure({.plant_tripped = &tripped, .plant_reason = [] { return std::string("too hot"); }});
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_EQ(result.message, "too hot");
  EXPECT_FALSE(complete(0));
}

TEST_F(RunResident, AStageLostInADownloadKeepsItsRows) {
  stage_.loses_download = 1;
  const ExperimentResult result = measure();
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_THAT(result.message, HasSubstr("the node fell silent"));
  EXPECT_THAT(samples_of_runs(), testing::ElementsAre(kSamples, kSamples / 2));
  EXPECT_TRUE(complete(0));
  EXPECT_FALSE(complete(1));
}

TEST_F(RunResident, AStageLostInAnUploadLeavesTheRunsBefore) {
  stage_.loses_upload = 2;
  const ExperimentResult result = measure();
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_EQ(result.runs_done, 2);
  EXPECT_THAT(samples_of_runs(), testing::ElementsAre(kSamples, kSamples, 0U));
  EXPECT_FALSE(complete(2));
}

TEST_F(RunResident, ARunLongerThanTheTraceIsRefused) {
  stage_.depth = kSamples - 1;
  EXPECT_THROW(measure(), std::invalid_argument);
}

TEST_F(RunResident, ALogOfAnotherPlanIsRefused) {
  SlogWriter log = SlogWriter::create(file_, experiment_log_info(plan_, stage_.info()));
  ExperimentSpec spec = plan_.spec();
  spec.periods = 3;
  spec.transient_periods = 0;
  const ExperimentPlan another{plan_.grid(), spec};
  EXPECT_THROW(run_resident_experiment(another, stage_, log, {}), std::invalid_argument);
}

}  // namespace stageid::test_run_resident
