#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "acquisition/files/counted.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/experiment/loop_check.hpp"
#include "tools/measure/measurement.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

Backend backend_of(const std::string& name, Backend configured) {
  if (name.empty()) return configured;
  if (const auto backend = from_word<Backend>(name)) return *backend;
  throw std::invalid_argument(
      fmt::format("--backend: unknown back end '{}'; use {}", name, one_of(kWords<Backend>)));
}

/// stageid run CONFIG -o run.slog
class RunCommand {
 public:
  RunCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::filesystem::path config_;
  std::filesystem::path output_;
  std::string backend_;
  std::filesystem::path replay_;
  double replay_tolerance_n_ = 1e-9;
  double pace_ = -1.0;
  std::filesystem::path excitation_;
  double until_ = 0.0;
  std::string dashboard_;
  bool resume_ = false;
  bool reset_fault_ = false;
};

RunCommand::RunCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(app, "run", "Perform the experiment and log every sample");
  command->add_option("config", config_, "experiment file (.yaml)")->required();
  command->add_option("-o,--output", output_, "log to write (.slog)")->required();
  command->add_option("--backend", backend_,
                      "sim | can | modbus | plugin | replay; default: from the stage file");
  command->add_option("--replay", replay_, "log to replay with --backend replay");
  command
      ->add_option("--replay-tolerance", replay_tolerance_n_,
                   "largest allowed difference between a command and the replayed one, in the unit "
                   "of the actuator")
      ->capture_default_str();
  command
      ->add_option("--pace", pace_,
                   "0: as fast as possible; 1: wall clock; default: from the stage file")
      ->check(kNotNegative);
  command->add_option("--excitation", excitation_,
                      "play this result of 'stageid design' instead of designing again");
  command
      ->add_option("--until", until_,
                   "VARIANCE: stop after the realization that lowers the mean relative variance of "
                   "the response to this value, e.g. 1e-6 for 0.1 %")
      ->check(kPositive);
  command->add_flag("--resume", resume_,
                    "continue an interrupted log; complete runs are not repeated");
  command->add_option("--dashboard", dashboard_,
                      "live view in a browser. PORT: on this machine (0: any free port) | "
                      "HOST:PORT: also on others. The printed address contains the token that "
                      "other machines and the stop button need");
  command->add_flag("--reset-fault", reset_fault_,
                    "clear a fault of the node or plant before the first run");
  command->final_callback([this] { run(); });
}

void RunCommand::run() const {
  const std::string ending = output_.extension().string();
  if (ending == ".h5" || ending == ".hdf5" || ending == ".csv")
    throw std::invalid_argument(
        fmt::format("{}: a measurement is recorded as .slog, which survives a crash; use a name "
                    "ending in .slog and 'stageid log convert' to obtain {}",
                    output_.string(), ending));
  require_ending(output_, "a log", {".slog"});
  const ExperimentConfig config = load_experiment_config(config_);
  const Backend backend = backend_of(backend_, config.stage.backend);
  if (backend != Backend::replay) require_stable_loop(config, console_);
  const ExperimentPlan plan =
      excitation_.empty() ? make_plan(config) : read_plan_of(config, excitation_);
  MeasurementRequest request;
  request.log = output_;
  request.backend = backend;
  request.replay = replay_;
  request.replay_tolerance_n = replay_tolerance_n_;
  request.resume = resume_;
  request.pace = pace_;
  if (!dashboard_.empty()) request.dashboard = parse_dashboard_address(dashboard_);
  request.reset_fault = reset_fault_;
  if (until_ > 0.0) request.until = until_;
  const MeasurementResult result = measure(config, plan, request, console_);
  console_.exit_code = result.exit_code;

  const RunHealth& health = result.experiment.health;
  const double stage_s = static_cast<double>(health.cycles) / plan.grid().sample_rate_hz();
  const int complete = result.runs_before + result.experiment.runs_done;
  console_.result(fmt::format(
      "{}: {} of {} complete{}", output_.string(), complete, counted(result.runs_total, "run"),
      result.runs_before > 0 ? fmt::format(" ({} of them before)", result.runs_before) : ""));
  console_.result(
      fmt::format("{}, {} late, {} missing, {} marked; {:.1f} s of stage time in "
                  "{:.1f} s, {:.1f} MB",
                  counted(health.cycles, "cycle"), health.late, health.missing, health.marked,
                  stage_s, result.seconds, static_cast<double>(result.log_bytes) / 1e6));
  if (result.variance) console_.result(result.message);
  nlohmann::ordered_json json = {{"log", output_.string()},
                                 {"exit_code", result.exit_code},
                                 {"message", result.message},
                                 {"runs_complete", complete},
                                 {"runs_total", result.runs_total},
                                 {"cycles", health.cycles},
                                 {"late", health.late},
                                 {"missing", health.missing},
                                 {"marked", health.marked},
                                 {"stage_seconds", stage_s},
                                 {"seconds", result.seconds},
                                 {"log_bytes", result.log_bytes}};
  if (result.variance) json["relative_variance"] = *result.variance;
  console_.result(json);
  if (result.exit_code != 0)
    console_.warning(fmt::format("{}{}", named(output_, result.message),
                                 complete < result.runs_total ? advice_behind(result) : ""));
}

}  // namespace

std::shared_ptr<void> run_command(CLI::App& app, Console& console) {
  return std::make_shared<RunCommand>(app, console);
}

}  // namespace stageid
