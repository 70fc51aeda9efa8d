// Resident experiments write the same log as the loop of the host, and keep their data if something fails.

#include "acquisition/loop/run_resident.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <tuple>
#include <utility>
#include <vector>

#include "acquisition/slog/slog_reader.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/resident_stage.hpp"
#include "tests/acquisition/loop/run_experiment_fixture.hpp"
#include "tests/support/process/file_size_limit.hpp"

namespace stageid::test_run_resident {

using testing::HasSubstr;

/// An analytic stage that closes the loop by itself, with scripted failures.
class PlayingStage final : public ResidentStage {
 public:
  PlayingStage() { plant_.noise = 1e-3; }

  // The script.
  std::uint64_t polls = 1;            ///< until a run is over
  std::function<void()> at_poll;      ///< called in every poll
  std::uint64_t fails_at = 0;         ///< rows after which a run fails; 0: never
  Outcome failure = Outcome::fault;   ///< its outcome
  int loses_upload = -1;              ///< the upload of this run throws
  int loses_download = -1;            ///< the download of this run stops half-way
  Outcome odd_outcome = Outcome::ok;  ///< of row 7

  int stops = 0;
  std::vector<Trigger> triggers;

  const StageInfo& info() const noexcept override { return plant_.info(); }
  std::uint64_t depth_samples() const noexcept override { return depth; }
  std::uint64_t depth = 1000;

  JobProgress upload(const Waveforms& waveforms) override {
    if (static_cast<int>(triggers.size()) == loses_upload) throw StageError("the node fell silent");
    waveforms_ = waveforms;
    return {JobStatus::done, 0, 0, ""};
  }

  JobProgress arm(const Trigger& trigger) override {
    triggers.push_back(trigger);
    polled_ = 0;
    play(trigger.run_seed);
    return {JobStatus::running, 0, 0, ""};
  }

  JobProgress poll() override {
    if (at_poll) at_poll();
    if (++polled_ < polls) return {JobStatus::running, polled_, rows_, ""};
    if (fails_at == 0) return {JobStatus::done, rows_, rows_, ""};
    return {JobStatus::failed, rows_, rows_, "the stage says no", failure};
  }

  JobProgress download(const TraceSink& sink) override {
    const std::size_t columns = info().actuators.size() + info().sensors.size();
    const bool lost = static_cast<int>(triggers.size()) - 1 == loses_download;
    const std::size_t rows = lost ? rows_ / 2 : rows_;
    for (std::size_t row = 0; row < rows; row += 64) {
      const std::size_t count = std::min<std::size_t>(64, rows - row);
      std::vector<Outcome> outcomes(count, Outcome::ok);
      if (row == 0) outcomes[7] = odd_outcome;
      sink({trace_.data() + row * columns, count * columns}, outcomes);
    }
    if (lost) throw StageError("the node fell silent");
    return {JobStatus::done, 0, 0, ""};
  }

  void stop() noexcept override { ++stops; }

 private:
  void play(std::uint64_t run_seed) {
    std::vector<double> y(info().sensors.size());
    std::vector<double> u(info().actuators.size());
    Inputs inputs;
    inputs.y = y;
    controller_.reset();
    plant_.start(run_seed, inputs);
    trace_.clear();
    const Eigen::Index period = waveforms_.samples.rows();
    rows_ = static_cast<std::size_t>(period) *
            static_cast<std::size_t>(waveforms_.periods + waveforms_.transient_periods);
    if (fails_at > 0) rows_ = fails_at;
    for (std::size_t n = 0; n < rows_; ++n) {
      controller_.update(y.data(), u.data());
      for (std::size_t i = 0; i < u.size(); ++i)
        u[i] +=
            waveforms_.samples(static_cast<Eigen::Index>(n) % period, static_cast<Eigen::Index>(i));
      trace_.insert(trace_.end(), u.begin(), u.end());
      trace_.insert(trace_.end(), y.begin(), y.end());
      static_cast<void>(plant_.exchange({n, u}, inputs, {}));
    }
    plant_.stop();
  }

  test::AnalyticStage plant_{test::RunExperimentTest::kActuators,
                             test::RunExperimentTest::kSensors};
  MotionController controller_{test::analytic_controller(plant_.info())};
  Waveforms waveforms_;
  std::vector<double> trace_;
  std::size_t rows_ = 0;
  std::uint64_t polled_ = 0;
};

struct RunResident : test::RunExperimentTest {
  ExperimentResult measure(const RunExperimentOptions& options = {}) {
    SlogWriter log = create("a.slog");
    const ExperimentResult result = run_resident_experiment(plan_, playing_, log, options);
    log.close(0, "done");
    return result;
  }

  using Runs = std::vector<std::pair<std::uint64_t, bool>>;  // samples, complete
  Runs runs() const {
    Runs runs;
    const SlogReader reader(file_);
    for (const LogRun& run : reader.runs()) runs.emplace_back(run.samples, run.complete);
    return runs;
  }

  std::filesystem::path file_ = directory_ / "a.slog";
  PlayingStage playing_;
};

TEST_F(RunResident, LeavesTheLogOfALoopOnThisSide) {
  EXPECT_EQ(measure().runs_done, 4);
  EXPECT_EQ(measure_into("b.slog").runs_done, 4);
  const SlogReader played(file_);
  const SlogReader streamed(directory_ / "b.slog");
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
  ASSERT_EQ(playing_.triggers.size(), 2U);
  EXPECT_EQ(playing_.triggers[0].run_seed, run_seed(17, {0, 1}));
}

TEST_F(RunResident, OddOutcomesOfTheTraceAreMarked) {
  playing_.odd_outcome = Outcome::late;
  const ExperimentResult result = measure();
  EXPECT_EQ(result.health.late, 4U);
  EXPECT_EQ(result.health.marked, 4U);
  EXPECT_EQ(result.health.missing, 0U);
  LogSamples samples;
  SlogReader(file_).read(0, 0, kSamples, samples);
  EXPECT_NE(samples.marked[7], 0);
  EXPECT_EQ((samples.marked != 0).count(), 1);
}

TEST_F(RunResident, ALimitOrAFaultOfTheStageEndsItWithWhatWasRecorded) {
  playing_.fails_at = 120;
  for (const auto& [failure, end] : {std::pair(Outcome::limit, ExperimentEnd::limit),
                                     std::pair(Outcome::fault, ExperimentEnd::fault)}) {
    std::filesystem::remove(file_);
    playing_.failure = failure;
    playing_.stops = 0;
    const ExperimentResult result = measure();
    EXPECT_EQ(result.end, end);
    EXPECT_THAT(result.message, HasSubstr("the stage says no"));
    EXPECT_EQ(runs(), (Runs{{120, false}}));
    EXPECT_GE(playing_.stops, 1);
  }
}

TEST_F(RunResident, AnInterruptStopsTheStageAndKeepsTheRest) {
  std::atomic<bool> interrupt = false;
  playing_.polls = 3;
  playing_.at_poll = [&] { interrupt = playing_.triggers.size() == 2; };
  const ExperimentResult result = measure({.interrupt = &interrupt});
  EXPECT_EQ(result.end, ExperimentEnd::interrupted);
  EXPECT_EQ(result.runs_done, 1);
  EXPECT_TRUE(runs().at(0).second);
  EXPECT_FALSE(runs().at(1).second);
  EXPECT_GE(playing_.stops, 1);
}

TEST_F(RunResident, ThePlantEndsItAndSaysWhy) {
  std::atomic<bool> tripped = false;
  playing_.polls = 3;
  playing_.at_poll = [&] { tripped = true; };
  const ExperimentResult result =
      measure({.plant_tripped = &tripped, .plant_reason = [] { return std::string("too hot"); }});
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_EQ(result.message, "too hot");
  EXPECT_FALSE(runs().at(0).second);
}

TEST_F(RunResident, AStageLostInADownloadKeepsItsRows) {
  playing_.loses_download = 1;
  const ExperimentResult result = measure();
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_THAT(result.message, HasSubstr("the node fell silent"));
  EXPECT_EQ(runs(), (Runs{{kSamples, true}, {kSamples / 2, false}}));
}

TEST_F(RunResident, AStageLostInAnUploadLeavesTheRunsBefore) {
  playing_.loses_upload = 2;
  const ExperimentResult result = measure();
  EXPECT_EQ(result.end, ExperimentEnd::fault);
  EXPECT_EQ(result.runs_done, 2);
  EXPECT_EQ(runs(), (Runs{{kSamples, true}, {kSamples, true}, {0, false}}));
}

TEST_F(RunResident, AFullDiskStopsTheStageAndKeepsWhatWasWritten) {
  for (const auto& [failure, fails_at, end] :
       {std::tuple(Outcome::ok, 0U, ExperimentEnd::log_failed),
        std::tuple(Outcome::limit, 250U, ExperimentEnd::limit)}) {
    std::filesystem::remove(file_);
    playing_.fails_at = fails_at;
    playing_.failure = failure;
    playing_.stops = 0;
    SlogWriter log = create("a.slog");
    ExperimentResult result;
    {
      const test::FileSizeLimit limit(log.bytes() + 9000);  // in the middle of a trace
      result = run_resident_experiment(plan_, playing_, log, {});
    }
    EXPECT_EQ(result.end, end) << "why the stage was stopped is more important";
    EXPECT_TRUE(result.log_failed);
    EXPECT_THAT(result.message, HasSubstr("cannot be written"));
    EXPECT_EQ(result.runs_done, 0);
    EXPECT_GE(playing_.stops, 1);
    EXPECT_EQ(SlogReader(file_, false).runs().at(0).samples, log.acknowledged_rows());
  }
}

TEST_F(RunResident, ARunLongerThanTheTraceIsRefused) {
  playing_.depth = kSamples - 1;
  EXPECT_THROW(measure(), std::invalid_argument);
}

TEST_F(RunResident, ALogOfAnotherPlanIsRefused) {
  SlogWriter log = create("a.slog");
  ExperimentSpec spec = plan_.spec();
  spec.periods = 3;
  spec.transient_periods = 0;
  const ExperimentPlan another{plan_.grid(), spec};
  EXPECT_THROW(run_resident_experiment(another, playing_, log, {}), std::invalid_argument);
}

}  // namespace stageid::test_run_resident
