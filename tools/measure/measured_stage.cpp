#include "tools/measure/measured_stage.hpp"

#include <fmt/format.h>

#include <map>
#include <stdexcept>

#include "acquisition/files/fail.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/loop/run_resident.hpp"
#include "acquisition/record/log_reader.hpp"
#include "hal/can/can_bus_load.hpp"
#include "hal/can/can_resident_stage.hpp"
#include "hal/can/can_socket.hpp"
#include "hal/can/can_stage.hpp"
#include "hal/can/can_zeromq.hpp"
#include "hal/modbus/modbus_stage.hpp"
#include "hal/plugin/plugin_stage.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/replay_stage.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

/// The host closes the loop, sample by sample.
class StreamedStage final : public MeasuredStage {
 public:
  StreamedStage(const ExperimentPlan& plan, std::unique_ptr<CyclicStage> stage,
                const StageSpec& spec)
      : plan_(plan), stage_(std::move(stage), spec.limits), controller_(spec.controller) {
    stage_.carry(spec.controller);
  }

  const StageInfo& info() const noexcept override { return stage_.info(); }

  ExperimentResult perform(RunWriter& log, const RunExperimentOptions& options) override {
    return run_experiment(plan_, stage_, controller_, log, options);
  }

  void explain(MeasurementResult& result) const override {
    add_trouble(result);
    judge_replay(result);
  }

  LimitViolation violation() const noexcept override { return stage_.violation(); }

 private:
  void add_trouble(MeasurementResult& result) const {
    const ExperimentEnd end = result.experiment.end;
    const std::string trouble = stage_.trouble();
    if (trouble.empty() || (end != ExperimentEnd::fault && end != ExperimentEnd::limit)) return;
    // A limit that only the node detected is not a violation on the host.
    const bool node_only =
        end == ExperimentEnd::limit && stage_.violation().kind == LimitKind::none;
    result.message = node_only ? trouble : result.message + "; " + trouble;
  }

  /// Adds the comparison of the replay stage to the result.
  void judge_replay(MeasurementResult& result) const {
    const auto* replay = dynamic_cast<const ReplayStage*>(&stage_.inner());
    if (replay == nullptr || replay->mismatches() == 0) return;
    result.message += fmt::format("; {} commands differ from the recorded ones, by up to {:.3g}{}",
                                  replay->mismatches(), replay->largest_mismatch_n(),
                                  common_unit(replay->info().actuators));
    if (result.exit_code == kDone) result.exit_code = kNotTrustworthy;
  }

  const ExperimentPlan& plan_;
  LimitedStage stage_;
  MotionController controller_;
};

/// The stage closes the loop itself.
class PlayingStage final : public MeasuredStage {
 public:
  PlayingStage(const ExperimentPlan& plan, std::unique_ptr<ResidentStage> stage)
      : plan_(plan), stage_(std::move(stage)) {}

  const StageInfo& info() const noexcept override { return stage_->info(); }
  ExperimentResult perform(RunWriter& log, const RunExperimentOptions& options) override {
    return run_resident_experiment(plan_, *stage_, log, options);
  }

 private:
  const ExperimentPlan& plan_;
  std::unique_ptr<ResidentStage> stage_;
};

/// @throws StageError if there is no such interface
std::unique_ptr<CanTransport> open_buses(const CanSpec& spec, const CanLayout& layout) {
  if (is_zeromq(spec.buses.front().interface))
    return std::make_unique<ZeroMqCan>(spec.buses.front().interface);
  std::vector<std::string> interfaces;
  for (const CanBusSpec& bus : spec.buses) interfaces.push_back(bus.interface);
  return std::make_unique<SocketCan>(interfaces, can_host_identifiers(layout));
}

/// The stage at the CAN interfaces of its file, with a node that answers.
/// @throws StageError if there is no interface, no node, or another node than described in the file.
template <typename Stage>
std::unique_ptr<Stage> make_can_stage(const StageConfig& config, const CanLayout& layout,
                                      const CanHostOptions& options) {
  const CanSpec& spec = config.can.spec;
  auto stage = std::make_unique<Stage>(config.spec.info, spec, open_buses(spec, layout), options);
  stage->connect();
  return stage;
}

/// Provides the runs of a log to the replay stage, in the order of a plan's runs.
class ReplayLog final : public ReplaySource {
 public:
  /// @throws std::invalid_argument if the log lacks a complete run of the list.
  ReplayLog(std::unique_ptr<LogReader> log, const std::vector<RunId>& runs) : log_(std::move(log)) {
    std::map<RunId, std::size_t> complete;  // of several, the last one is used, as in the estimate
    for (std::size_t i = 0; i < log_->runs().size(); ++i)
      if (const LogRun& run = log_->runs()[i]; run.complete)
        complete[{run.realization, run.experiment}] = i;
    for (const RunId wanted : runs) {
      if (!complete.contains(wanted))
        fail_request(
            "{}: no complete run of realization {}, experiment {}; replay the log of the same "
            "experiment",
            log_->path().string(), wanted.realization + 1, wanted.experiment + 1);
      order_.push_back(complete[wanted]);
    }
  }

  int runs() const override { return static_cast<int>(order_.size()); }
  void load(int run, Eigen::MatrixXd& u, Eigen::MatrixXd& y, Eigen::VectorXi& marked) override {
    const std::size_t index = order_.at(run);
    LogSamples samples;
    log_->read(index, 0, log_->runs()[index].samples, samples);
    u = samples.actuators.transpose();
    y = samples.sensors.transpose();
    marked = samples.marked.cast<int>();
  }

 private:
  std::unique_ptr<LogReader> log_;
  std::vector<std::size_t> order_;
};

std::unique_ptr<CyclicStage> replayed_stage(const ExperimentConfig& config,
                                            const ExperimentPlan& plan,
                                            const MeasurementRequest& request,
                                            const std::vector<RunId>& skip) {
  if (request.replay.empty())
    throw std::invalid_argument("--backend replay: no log given; add --replay LOG");
  StageInfo info = config.stage.spec.info;
  info.backend = "replay";
  return std::make_unique<ReplayStage>(
      std::move(info),
      std::make_unique<ReplayLog>(open_log(request.replay), plan.runs_without(skip)),
      request.replay_tolerance_n);
}

}  // namespace

void require_backend(const ExperimentConfig& config, Backend backend, double pace) {
  const bool there = backend == Backend::can      ? config.stage.can.present
                     : backend == Backend::modbus ? config.stage.modbus.has_value()
                     : backend == Backend::plugin ? config.stage.plugin.has_value()
                                                  : true;
  if (!there)
    fail_request("--backend {0}: {1} has no group '{0}'; see 'stageid config schema'",
                 to_string(backend), config.stage.file.string());
  if (backend == Backend::sim && !config.stage.plant)
    fail_request("--backend sim: {} has no group 'plant', which is the simulated stage; add it",
                 config.stage.file.string());
  const bool resident = backend == Backend::can && config.stage.can.mode == CanMode::resident;
  if (config.stage.spec.controller.by_peer && !resident)
    fail_request(
        "{}: 'controller: peer' needs a stage that plays the excitation in a loop of its own: "
        "'backend: can' with 'mode: resident'. With back end {}, this program closes the loop; "
        "write its controller",
        config.stage.file.string(), to_string(backend));
  const bool virtual_link =
      (backend == Backend::can || backend == Backend::modbus) && !(pace > 0.0);
  if (config.stage.between_runs == BetweenRuns::hold && virtual_link && !resident)
    fail_request(
        "{}: 'between_runs: hold' with back end {} needs the wall clock, because the watchdog of "
        "the node runs by it. Set 'pace: 1'",
        config.stage.file.string(), to_string(backend));
  if (config.stage.between_runs == BetweenRuns::hold && resident)
    fail_request(
        "{}: 'between_runs: hold' is not possible with 'mode: resident', because the node closes "
        "the loop and cuts its forces after every run. Use 'mode: streaming', or 'between_runs: "
        "release'",
        config.stage.file.string());
}

std::unique_ptr<MeasuredStage> make_measured_stage(const ExperimentConfig& config,
                                                   const ExperimentPlan& plan,
                                                   const MeasurementRequest& request,
                                                   const std::vector<RunId>& skip) {
  StageSpec spec = config.stage.spec;
  const double pace = request.pace >= 0.0 ? request.pace : config.stage.pace;
  require_backend(config, request.backend, pace);
  const auto streamed = [&](std::unique_ptr<CyclicStage> stage) {
    return std::make_unique<StreamedStage>(plan, std::move(stage), spec);
  };
  // A recorded motion was caused by other forces.
  if (request.backend == Backend::replay) spec.limits.motion = {};
  switch (request.backend) {
    case Backend::sim:
      return streamed(std::make_unique<SimulatedStage>(spec.info, config.stage.plant.value(),
                                                       config.stage.simulation, pace));
    case Backend::can: {
      const CanHostOptions options{pace, request.reset_fault,
                                   [] { return interrupt_flag().load(); }};
      const CanSpec& can = config.stage.can.spec;
      const CanLayout layout = can_layout(can, spec.info);
      if (config.stage.can.mode == CanMode::resident)
        return std::make_unique<PlayingStage>(
            plan, make_can_stage<CanResidentStage>(config.stage, layout, options));
      require_bus_carries(can, layout, spec.info.sample_rate_hz);  // before an interface is opened
      return streamed(make_can_stage<CanStage>(config.stage, layout, options));
    }
    case Backend::modbus:
      return streamed(std::make_unique<ModbusStage>(
          config.stage.spec.info, config.stage.modbus->address, config.stage.modbus->timing,
          ModbusHostOptions{pace, request.reset_fault}));
    case Backend::plugin:
      return streamed(std::make_unique<PluginStage>(spec.info, *config.stage.plugin, pace));
    case Backend::replay:
      break;
  }
  return streamed(replayed_stage(config, plan, request, skip));
}

}  // namespace stageid
