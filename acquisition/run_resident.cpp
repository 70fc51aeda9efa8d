#include "acquisition/run_resident.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <ctime>
#include <stdexcept>
#include <thread>
#include <vector>

#include "acquisition/slog_format.hpp"

namespace stageid {
namespace {

constexpr std::chrono::milliseconds kPollEvery{20};

/// Puts downloaded rows into the log as they come.
class LogSink final : public TraceSink {
 public:
  LogSink(SlogWriter& log, std::size_t columns) : log_(log), columns_(columns) {}

  void rows(std::uint64_t, std::span<const double> values,
            std::span<const Outcome> outcomes) override {
    block_.clear();
    for (std::size_t row = 0; row < outcomes.size(); ++row) {
      const auto from = values.begin() + static_cast<std::ptrdiff_t>(row * columns_);
      block_.insert(block_.end(), from, from + static_cast<std::ptrdiff_t>(columns_));
      SampleStatus status;
      status.outcome = static_cast<std::uint8_t>(outcomes[row]);
      status.marked = outcomes[row] != Outcome::ok;
      block_.push_back(std::bit_cast<double>(pack_status(status)));
      ++health.cycles;
      health.marked += status.marked ? 1U : 0U;
      health.late += outcomes[row] == Outcome::late ? 1U : 0U;
      health.missing += status.marked && outcomes[row] != Outcome::late ? 1U : 0U;
    }
    log_.write(block_);
  }

  RunHealth health;

 private:
  SlogWriter& log_;
  std::size_t columns_;
  std::vector<double> block_;
};

class ResidentExperiment {
 public:
  ResidentExperiment(const ExperimentPlan& plan, ResidentStage& stage, SlogWriter& log,
                     const RunExperimentOptions& options)
      : plan_(plan), stage_(stage), log_(log), options_(options) {
    for (const RunId& run : plan.runs())
      if (std::find(options.skip.begin(), options.skip.end(), run) == options.skip.end())
        runs_.push_back(run);
  }

  ExperimentResult perform() {
    result_.end = ExperimentEnd::complete;
    for (const RunId& run : runs_) {
      if (interrupted()) result_.end = ExperimentEnd::interrupted;
      if (plant_tripped()) end_with_plant();
      if (result_.end != ExperimentEnd::complete) break;
      perform_run(run);
    }
    stage_.stop();
    if (result_.end == ExperimentEnd::complete)
      result_.message = fmt::format("{} runs measured", result_.runs_done);
    if (result_.end == ExperimentEnd::interrupted)
      result_.message = "interrupted; what was measured is kept";
    return std::move(result_);
  }

 private:
  void perform_run(RunId id) {
    const auto started = std::chrono::steady_clock::now();
    const Waveforms waveforms = waveforms_of(id);
    LogRun run;
    run.realization = id.realization;
    run.experiment = id.experiment;
    run.started_utc = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
    log_.begin_run(run, plan_.excitation(id));
    LogSink sink(log_, stage_.info().actuators.size() + stage_.info().sensors.size());
    try {
      static_cast<void>(stage_.upload(waveforms));
      play(id);
      static_cast<void>(stage_.download(sink));
    } catch (const StageError& error) {
      end_with(ExperimentEnd::fault, error.what());
    }
    run.health = sink.health;
    run.health.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
    run.complete = result_.end == ExperimentEnd::complete &&
                   sink.health.cycles == static_cast<std::uint64_t>(plan_.samples_per_run());
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
      if (interrupted()) {
        stage_.stop();
        result_.end = ExperimentEnd::interrupted;
        return;
      }
      if (plant_tripped()) {
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

  Waveforms waveforms_of(RunId id) const {
    const Eigen::MatrixXd excitation = plan_.excitation(id);
    const std::vector<Channel>& actuators = stage_.info().actuators;
    Waveforms waveforms;
    waveforms.periods = plan_.spec().periods;
    waveforms.transient_periods = plan_.spec().transient_periods;
    waveforms.samples.setZero(excitation.rows(), static_cast<Eigen::Index>(actuators.size()));
    for (Eigen::Index column = 0; column < excitation.cols(); ++column) {
      const std::string& name = plan_.spec().axes[static_cast<std::size_t>(column)].channel;
      for (std::size_t i = 0; i < actuators.size(); ++i)
        if (actuators[i].name == name)
          waveforms.samples.col(static_cast<Eigen::Index>(i)) = excitation.col(column);
    }
    return waveforms;
  }

  void end_with(ExperimentEnd end, std::string message) {
    if (result_.end != ExperimentEnd::complete) return;  // the first reason counts
    result_.end = end;
    result_.message = std::move(message);
  }

  bool plant_tripped() const noexcept {
    return options_.plant_tripped != nullptr &&
           options_.plant_tripped->load(std::memory_order_relaxed);
  }

  void end_with_plant() {
    end_with(ExperimentEnd::fault,
             options_.plant_reason ? options_.plant_reason() : "the plant tripped");
  }

  bool interrupted() const noexcept {
    return options_.interrupt != nullptr && options_.interrupt->load(std::memory_order_relaxed);
  }

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
  SlogWriter& log_;
  const RunExperimentOptions& options_;
  std::vector<RunId> runs_;
  ExperimentResult result_;
};

}  // namespace

ExperimentResult run_resident_experiment(const ExperimentPlan& plan, ResidentStage& stage,
                                         SlogWriter& log, const RunExperimentOptions& options) {
  if (!same_measurement(log.info(), experiment_log_info(plan, stage.info())))
    throw std::invalid_argument(
        "experiment: the log was made for another plan or stage; make it with "
        "experiment_log_info()");
  const auto samples = static_cast<std::uint64_t>(plan.samples_per_run());
  if (samples > stage.depth_samples())
    throw std::invalid_argument(fmt::format(
        "experiment: {} samples a run, the stage '{}' records {} at most; fewer periods", samples,
        stage.info().name, stage.depth_samples()));
  return ResidentExperiment(plan, stage, log, options).perform();
}

}  // namespace stageid
