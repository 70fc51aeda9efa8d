#include "acquisition/loop/run_resident.hpp"

#include <fmt/format.h>

#include <bit>
#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/loop/excited_actuators.hpp"
#include "acquisition/record/utc_time.hpp"
#include "acquisition/slog/slog_format.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

constexpr std::chrono::milliseconds kPollEvery{20};

class ResidentExperiment {
 public:
  ResidentExperiment(const ExperimentPlan& plan, ResidentStage& stage, RunWriter& log,
                     const RunExperimentOptions& options)
      : plan_(plan),
        stage_(stage),
        log_(log),
        options_(options),
        actuators_(excited_actuators(plan.spec(), stage.info())),
        runs_(plan.runs_without(options.skip)) {}

  ExperimentResult perform() {
    result_.end = ExperimentEnd::complete;
    std::string enough;
    int realization = -1;
    for (const RunId& run : runs_) {
      if (options_.interrupted()) result_.end = ExperimentEnd::interrupted;
      if (options_.tripped()) end_with_plant();
      if (result_.end != ExperimentEnd::complete) break;
      if (options_.enough && run.realization != std::exchange(realization, run.realization)) {
        enough = options_.enough();
        if (!enough.empty()) break;
      }
      try {
        perform_run(run);
      } catch (const FileError& error) {
        result_.take_log_failure(error.what());
      }
    }
    stage_.stop();
    if (result_.end == ExperimentEnd::complete)
      result_.message = fmt::format("{}{}{} measured", enough, enough.empty() ? "" : "; ",
                                    counted(result_.runs_done, "run"));
    if (result_.end == ExperimentEnd::interrupted)
      result_.message = "interrupted; the measured data are kept";
    return std::move(result_);
  }

 private:
  void perform_run(RunId id) {
    const auto started = std::chrono::steady_clock::now();
    const Waveforms waveforms = waveforms_of(id);
    LogRun run;
    run.realization = id.realization;
    run.experiment = id.experiment;
    run.started_utc = utc_now();
    log_.begin_run(run, plan_.excitation(id));
    try {
      static_cast<void>(stage_.upload(waveforms));
      play(id);
      static_cast<void>(stage_.download(
          [&](auto values, auto outcomes) { write_rows(values, outcomes, run.health); }));
    } catch (const StageError& error) {
      end_with(options_.interrupted() ? ExperimentEnd::interrupted : ExperimentEnd::fault,
               error.what());
    }
    run.health.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
    run.complete = result_.end == ExperimentEnd::complete &&
                   run.health.cycles == static_cast<std::uint64_t>(plan_.samples_per_run());
    log_.end_run(run);
    log_.synchronize();
    result_.health += run.health;
    result_.runs_done += run.complete ? 1 : 0;
  }

  void play(RunId id) {
    Trigger trigger;
    trigger.run_seed = run_seed(plan_.spec().seed, id);
    trigger.ramp_s = options_.ramp_s;
    JobProgress progress = stage_.arm(trigger);
    while (progress.status == JobStatus::running) {
      report(id, progress);
      if (options_.interrupted()) {
        stage_.stop();
        result_.end = ExperimentEnd::interrupted;
        return;
      }
      if (options_.tripped()) {
        stage_.stop();
        end_with_plant();
        return;
      }
      std::this_thread::sleep_for(kPollEvery);
      progress = stage_.poll();
    }
    report(id, progress);
    if (progress.status == JobStatus::failed)
      end_with(progress.outcome == Outcome::limit ? ExperimentEnd::limit : ExperimentEnd::fault,
               fmt::format("stage '{}': {}", stage_.info().name, progress.message));
  }

  /// Writes downloaded rows to the log as they arrive.
  void write_rows(std::span<const double> values, std::span<const Outcome> outcomes,
                  RunHealth& health) {
    const std::size_t columns = stage_.info().actuators.size() + stage_.info().sensors.size();
    std::vector<double> block;
    for (std::size_t row = 0; row < outcomes.size(); ++row) {
      const auto cells = values.subspan(row * columns, columns);
      block.insert(block.end(), cells.begin(), cells.end());
      SampleStatus status;
      status.outcome = static_cast<std::uint8_t>(outcomes[row]);
      status.marked = outcomes[row] != Outcome::ok;
      block.push_back(std::bit_cast<double>(pack_status(status)));
      ++health.cycles;
      health.marked += status.marked ? 1U : 0U;
      health.late += outcomes[row] == Outcome::late ? 1U : 0U;
      health.missing += status.marked && outcomes[row] != Outcome::late ? 1U : 0U;
    }
    log_.write(block);
  }

  Waveforms waveforms_of(RunId id) const {
    const Eigen::MatrixXd excitation = plan_.excitation(id);
    Waveforms waveforms;
    waveforms.periods = plan_.spec().periods;
    waveforms.transient_periods = plan_.spec().transient_periods;
    waveforms.samples.setZero(excitation.rows(),
                              static_cast<Eigen::Index>(stage_.info().actuators.size()));
    for (Eigen::Index axis = 0; axis < excitation.cols(); ++axis)
      waveforms.samples.col(actuators_[axis]) = excitation.col(axis);
    return waveforms;
  }

  void end_with(ExperimentEnd end, std::string message) {
    if (result_.end != ExperimentEnd::complete) return;  // the first reason is kept
    result_.end = end;
    result_.message = std::move(message);
  }

  void end_with_plant() { end_with(ExperimentEnd::fault, options_.trip_reason()); }

  void report(RunId id, const JobProgress& progress) const {
    if (!options_.progress) return;
    ExperimentProgress now;
    now.run = id;
    now.runs_done = result_.runs_done;
    now.runs_total = static_cast<int>(runs_.size());
    const double rate_hz = plan_.grid().sample_rate_hz();
    const double run_s = static_cast<double>(plan_.samples_per_run()) / rate_hz;
    now.seconds_total = run_s * now.runs_total;
    now.seconds_done = run_s * now.runs_done + static_cast<double>(progress.done) / rate_hz;
    options_.progress(now);
  }

  const ExperimentPlan& plan_;
  ResidentStage& stage_;
  RunWriter& log_;
  const RunExperimentOptions& options_;
  std::vector<int> actuators_;
  std::vector<RunId> runs_;
  ExperimentResult result_;
};

}  // namespace

ExperimentResult run_resident_experiment(const ExperimentPlan& plan, ResidentStage& stage,
                                         RunWriter& log, const RunExperimentOptions& options) {
  require(same_measurement(log.info(), experiment_log_info(plan, stage.info())),
          "experiment: the log was created for a different plan or stage; create it with "
          "experiment_log_info()");
  const auto samples = static_cast<std::uint64_t>(plan.samples_per_run());
  if (samples > stage.depth_samples())
    fail_request(
        "experiment: {} samples per run, but stage '{}' records at most {}; lower the number of "
        "periods",
        samples, stage.info().name, stage.depth_samples());
  return ResidentExperiment(plan, stage, log, options).perform();
}

}  // namespace stageid
