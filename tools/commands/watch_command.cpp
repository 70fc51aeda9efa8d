#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "acquisition/record/event_log.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/commands/commands.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"
#include "tools/watch/stage_watch.hpp"

namespace stageid {
namespace {

/// stageid watch MODEL LOG
struct WatchFlags {
  WatchOptions options;
  std::filesystem::path log;
  std::filesystem::path output;
  std::filesystem::path events;
  bool follow = false;
};

void watch(const WatchFlags& flags, Console& console) {
  StageWatch watch(flags.options, console);
  for (const std::filesystem::path& output : {flags.output, flags.events})
    if (!output.empty()) require_no_input(output, {flags.options.model, flags.log});
  std::optional<EventLog> events;
  if (!flags.output.empty()) watch.write_tracks(flags.output);
  if (!flags.events.empty()) watch.write_events(events.emplace(flags.events));
  {
    const ControlledStop stop;
    Progress progress(console, "watch", "s of stage time/s");
    watch.run(flags.log, flags.follow, [&](double time_s) {
      progress.update(time_s, 0.0);
      return !interrupt_flag();
    });
  }
  if (watch.stage_changed()) console.exit_code = kNotTrustworthy;
  if (const std::string why = watch.doubt(); !why.empty()) {
    console.exit_code = kNotTrustworthy;
    console.warning("{}: {}", flags.log.string(), why);
  }
  for (const std::string& line : watch.lines()) console.result(line);
  console.result(watch.summary());
  Json json = watch.json();
  json["log"] = flags.log.string();
  console.result(json);
  if (interrupt_flag()) console.exit_code = kInterrupted;
  if (events && !events->error().empty()) throw FileError(events->error());
}

}  // namespace

std::vector<CLI::Option*> add_watch_options(CLI::App& command, WatchOptions& options) {
  return {add_band(command, options.band_hz, "the band of the fit"),
          add_setting(command, "--learn", options.learn, "PERIODS",
                      "periods without change, from which noise and reference are learned",
                      CLI::Range(4, 10000)),
          add_value(command, "--memory", options.memory_s, "SECONDS",
                    "s; after this time the weight of a period is 1/e; default: 100 periods",
                    kPositive),
          add_setting(command, "--false-alarms", options.false_alarms, "RATE",
                      "rate of alarms without change: NUMBER/period, /hour, /day, /week or /year")};
}

void watch_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(
      app, console, "watch", "Track a working stage around its model; tell what changes", watch);
  add_required(command, "model", flags.options.model, "model.json");
  add_required(command, "log", flags.log, "log of the working stage (.slog or .h5)");
  command.add_flag("--follow", flags.follow,
                   "the log (.slog) is being written: wait for more until it ends");
  command.add_option("-o,--output", flags.output, "watch.h5: what was tracked, a row per period");
  command.add_option("--events", flags.events, "JSON lines of the changes, written as they happen");
  add_watch_options(command, flags.options);
}

}  // namespace stageid
