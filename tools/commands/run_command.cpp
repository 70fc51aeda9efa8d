#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <string>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/experiment/loop_check.hpp"
#include "tools/measure/measurement.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

Backend backend_of(const std::string& name, Backend configured) {
  if (name.empty()) return configured;
  if (const auto backend = from_word<Backend>(name)) return *backend;
  fail_request("--backend: unknown back end '{}'; use {}", name, one_of(kWords<Backend>));
}

/// stageid run CONFIG -o run.slog
struct RunFlags {
  std::filesystem::path config;
  std::filesystem::path excitation;
  std::string backend;
  std::string dashboard;
  bool force = false;
  WatchOptions watch;
  MeasurementRequest request;
};

void measure_and_log(const RunFlags& flags, Console& console) {
  MeasurementRequest request = flags.request;
  const std::string ending = request.log.extension().string();
  if (ending == ".h5" || ending == ".hdf5" || ending == ".csv")
    fail_request(
        "{}: a measurement is recorded as .slog, which survives a crash; use a name "
        "ending in .slog and 'stageid log convert' to obtain {}",
        request.log.string(), ending);
  require_ending(request.log, "a log", {".slog"});
  const ExperimentConfig config = load_experiment_config(flags.config);
  request.backend = backend_of(flags.backend, config.stage.backend);
  if (request.backend != Backend::replay) require_stable_loop(config, console);
  const ExperimentPlan plan =
      flags.excitation.empty() ? make_plan(config) : read_plan_of(config, flags.excitation);
  if (request.backend != Backend::replay)
    require_within_limits(config, predict_signals(config, plan, console), flags.force, console);
  if (!flags.dashboard.empty()) request.dashboard = parse_dashboard_address(flags.dashboard);
  if (!flags.watch.model.empty()) request.watch = flags.watch;
  const MeasurementResult result = measure(config, plan, request, console);
  console.exit_code = result.exit_code;

  const RunHealth& health = result.experiment.health;
  const double stage_s = static_cast<double>(health.cycles) / plan.grid().sample_rate_hz();
  const int complete = result.runs_before + result.experiment.runs_done;
  console.result(
      "{}: {} of {} complete{}", request.log.string(), complete, counted(result.runs_total, "run"),
      result.runs_before > 0 ? fmt::format(" ({} of them before)", result.runs_before) : "");
  console.result(
      "{}, {} late, {} missing, {} marked; {:.1f} s of stage time in {:.1f} s, {:.1f} MB",
      counted(health.cycles, "cycle"), health.late, health.missing, health.marked, stage_s,
      result.seconds, static_cast<double>(result.log_bytes) / 1e6);
  if (result.variance) console.result(result.message);
  if (request.watch) console.result("watch: " + result.watch_summary);
  Json json = {{"log", request.log.string()},
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
  if (request.watch) json["watch"] = result.watch;
  console.result(json);
  if (result.exit_code != 0)
    console.warning("{}{}", named(request.log, result.message),
                    complete < result.runs_total ? advice_behind(result) : "");
  result.show_end();
}

}  // namespace

void run_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(
      app, console, "run", "Perform the experiment and log every sample", measure_and_log);
  add_required(command, "config", flags.config, "experiment file (.yaml)");
  add_required(command, "-o,--output", flags.request.log, "log to write (.slog)");
  command.add_option("--backend", flags.backend,
                     "sim | can | modbus | plugin | replay; default: from the stage file");
  command.add_option("--replay", flags.request.replay, "log to replay with --backend replay");
  add_setting(command, "--replay-tolerance", flags.request.replay_tolerance_n, "TOLERANCE",
              "largest allowed difference between a command and the replayed one, in the unit "
              "of the actuator");
  add_value(command, "--pace", flags.request.pace, "SPEED",
            "0: as fast as possible; 1: wall clock; default: from the stage file", kNotNegative);
  command.add_option("--excitation", flags.excitation,
                     "play this result of 'stageid design' instead of designing again");
  add_value(command, "--until", flags.request.until, "VARIANCE",
            "stop after the realization that lowers the mean relative variance of the "
            "response to this value, e.g. 1e-6 for 0.1 % rms",
            kPositive);
  command.add_flag("--resume", flags.request.resume,
                   "continue an interrupted log; complete runs are not repeated");
  add_value(command, "--dashboard", flags.dashboard, "ADDRESS",
            "live view in a browser. PORT: on this machine (0: any free port) | "
            "HOST:PORT: also on other machines. These and the stop button need the "
            "access token in the printed address");
  CLI::Option* const watch =
      command.add_option("--watch", flags.watch.model,
                         "model.json: report how the stage differs from this model during the run");
  for (CLI::Option* const option : add_watch_options(command, flags.watch)) option->needs(watch);
  add_force(command, flags.force);
  command.add_flag("--reset-fault", flags.request.reset_fault,
                   "clear a fault of the node or plant before the first run");
}

}  // namespace stageid
