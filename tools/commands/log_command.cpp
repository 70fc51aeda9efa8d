#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/formats/convert_log.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "acquisition/slog/slog_recover.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/exchange/matlab/mat_log.hpp"
#include "tools/experiment/run_metadata.hpp"
#include "tools/report/timing_json.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

Json counts_json(const RunHealth& health) {
  return {{"cycles", health.cycles},       {"late", health.late},
          {"missing", health.missing},     {"marked", health.marked},
          {"irregular", health.irregular}, {"largest_lateness_ns", health.largest_lateness_ns},
          {"seconds", health.seconds}};
}

/// Timing of the loop over all runs; empty in virtual time.
std::vector<std::string> timing_lines(const LogReader& log) {
  RunTiming timing;
  for (const LogRun& run : log.runs()) timing += run.timing;
  if (timing.empty()) return {};
  const double period_s = wall_period_s(log.info());
  const auto line = [&](const char* what, const TimingHistogram& histogram) {
    const auto of = [&](double share) {
      const double seconds = histogram.quantile_s(share);
      const std::string part =
          period_s > 0.0 ? fmt::format(" ({:.2g} %)", 100.0 * seconds / period_s) : "";
      return fmt::format("{:.3g} us{}", 1e6 * seconds, part);
    };
    return fmt::format("{} median < {}, 99 % < {}, 99.9 % < {}, all < {}", what, of(0.5), of(0.99),
                       of(0.999), of(1.0));
  };
  return {
      line("execution ", timing.execution), line("lateness  ", timing.lateness),
      fmt::format("skipped    {} of {:.4g} us", counted(timing.skipped, "period"), 1e6 * period_s)};
}

Json damage_json(const std::vector<LogDamage>& damage) {
  Json list = Json::array();
  for (const LogDamage& d : damage)
    list.push_back({{"offset", d.offset}, {"bytes", d.bytes}, {"what", d.what}});
  return list;
}

std::string damage_line(const LogDamage& damage) {
  return fmt::format("damaged at byte {}, {}: {}", damage.offset, counted(damage.bytes, "byte"),
                     damage.what);
}

Json info_json(const LogReader& log) {
  const LogInfo& info = log.info();
  Json json = {
      {"file", log.path().string()},           {"sample_rate_hz", info.sample_rate_hz},
      {"period_samples", info.period_samples}, {"transient_periods", info.transient_periods},
      {"excitation", info.excitation.names},   {"actuators", info.actuators.names},
      {"sensors", info.sensors.names},         {"runs", Json::array()}};
  for (const LogRun& run : log.runs())
    json["runs"].push_back({{"name", run.name},
                            {"realization", run.realization},
                            {"experiment", run.experiment},
                            {"samples", run.samples},
                            {"complete", run.complete},
                            {"started_utc", run.started_utc},
                            {"health", counts_json(run.health)},
                            {"timing", timing_json(run.timing)}});
  json["metadata"] = parse_json<Json>(info.metadata_json);
  return json;
}

/// stageid log info | verify | recover | convert FILE ...
struct LogFlags {
  std::filesystem::path file;
  std::filesystem::path output;
  bool complete_only = false;
  MatVersion mat_version = MatVersion::v5;
  bool health = false;
  std::filesystem::path stage;
};

void list_log(const LogFlags& flags, Console& console) {
  const std::unique_ptr<LogReader> log = open_log(flags.file);
  const LogInfo& info = log->info();
  console.result("{}: {} Hz, period {} ({} s), {}", flags.file.string(), info.sample_rate_hz,
                 counted(info.period_samples, "sample"), info.period_samples / info.sample_rate_hz,
                 counted(info.transient_periods, "transient period"));
  console.result("excitation {}", fmt::join(info.excitation.names, " "));
  console.result("actuators  {}", fmt::join(info.actuators.names, " "));
  console.result("sensors    {}", fmt::join(info.sensors.names, " "));
  std::vector<std::vector<std::string>> rows = {
      {"run", "realization", "experiment", "samples", "late", "missing", "marked", "", "started"}};
  for (const LogRun& run : log->runs())
    rows.push_back({run.name, fmt::format("{}", run.realization + 1),
                    fmt::format("{}", run.experiment + 1), fmt::format("{}", run.samples),
                    fmt::format("{}", run.health.late), fmt::format("{}", run.health.missing),
                    fmt::format("{}", run.health.marked), run.complete ? "complete" : "INCOMPLETE",
                    run.started_utc});
  for (const std::string& line : table_lines(rows)) console.result(line);
  for (const std::string& line : timing_lines(*log)) console.result(line);
  Json json = info_json(*log);
  if (flags.health) {
    const std::vector<Finding> findings = examine_log(*log, flags.stage, console);
    for (const std::string& line : health_lines(findings)) console.result(line);
    json["health"] = health_json(findings);
    if (any_fault(findings)) console.exit_code = kNotTrustworthy;
  }
  console.result(json);
}

void verify_file(const LogFlags& flags, Console& console) {
  const VerifyReport report = verify_log(flags.file);
  throw_if_interrupted();
  console.result("{}: {:.1f} MB, {}, {} ({} marked), {} of {} complete", flags.file.string(),
                 static_cast<double>(report.bytes) / 1e6, counted(report.blocks, "block"),
                 counted(report.rows, "row"), report.marked_rows, report.complete_runs,
                 counted(report.runs, "run"));
  for (const LogDamage& damage : report.damage) console.result(damage_line(damage));
  if (report.closed && !report.exit_message.empty())
    console.result("ended with {}: {}", report.exit_code, report.exit_message);
  console.result({{"file", flags.file.string()},
                  {"intact", report.intact()},
                  {"closed", report.closed},
                  {"bytes", report.bytes},
                  {"blocks", report.blocks},
                  {"rows", report.rows},
                  {"marked_rows", report.marked_rows},
                  {"runs", report.runs},
                  {"complete_runs", report.complete_runs},
                  {"damage", damage_json(report.damage)}});
  if (report.intact()) {
    console.result("intact");
    return;
  }
  const std::string what = !report.damage.empty()
                               ? "damaged at " + counted(report.damage.size(), "place")
                               : "was not closed: the experiment was interrupted";
  fail_format(flags.file, "",
              "{}; save the intact part with 'stageid log recover {} -o "
              "NEW.slog', or continue the experiment with --resume",
              what, flags.file.string());
}

void recover_file(const LogFlags& flags, Console& console) {
  if (std::filesystem::exists(flags.output))
    fail_request("{}: already exists; choose another name with -o", flags.output.string());
  const RecoverReport report = recover_log(flags.file, flags.output);
  for (const LogDamage& damage : report.damage) console.result(damage_line(damage));
  console.result("{}: {}, {}, {} of {} complete; lost: {}, {}, {}", flags.output.string(),
                 counted(report.blocks_kept, "block"), counted(report.rows_kept, "row"),
                 report.complete_runs, counted(report.runs, "run"),
                 counted(report.blocks_lost, "block"), counted(report.rows_lost, "row"),
                 counted(report.bytes_lost, "byte"));
  console.result({{"output", flags.output.string()},
                  {"blocks_kept", report.blocks_kept},
                  {"blocks_lost", report.blocks_lost},
                  {"rows_kept", report.rows_kept},
                  {"rows_lost", report.rows_lost},
                  {"bytes_lost", report.bytes_lost},
                  {"runs", report.runs},
                  {"complete_runs", report.complete_runs},
                  {"damage", damage_json(report.damage)}});
}

void convert_file(const LogFlags& flags, Console& console) {
  require_no_input(flags.output, {flags.file});
  const std::unique_ptr<LogReader> log = open_log(flags.file);
  Progress progress(console, "convert", "rows");
  ConvertOptions options;
  options.incomplete_runs = !flags.complete_only;
  options.progress = [&](std::uint64_t done, std::uint64_t total) {
    throw_if_interrupted();
    progress.update(static_cast<double>(done), static_cast<double>(total));
  };
  if (flags.output.extension() == ".mat")
    write_mat_log(*log, flags.output, flags.mat_version, options);
  else
    convert_log(*log, flags.output, options);
  console.result("wrote {}, {:.1f} MB", flags.output.string(),
                 static_cast<double>(std::filesystem::file_size(flags.output)) / 1e6);
  console.result(
      {{"output", flags.output.string()}, {"bytes", std::filesystem::file_size(flags.output)}});
}

}  // namespace

void log_command(CLI::App& app, Console& console) {
  CLI::App& log = add_command(app, "log", "Inspect, verify, recover or convert a log");
  log.require_subcommand(1);
  auto [info, info_flags] =
      add_command(log, console, "info", "List the contents of a log, run by run", list_log);
  add_required(info, "file", info_flags.file, "log (.slog or .h5)");
  info.add_flag("--health", info_flags.health, "read all samples and report health findings");
  info.add_option(
      "--stage", info_flags.stage,
      "with --health: stage or controller file for the checks; default: the one stored in the log");

  auto [verify, verify_flags] =
      add_command(log, console, "verify", "Read every byte and verify the checksums", verify_file);
  add_required(verify, "file", verify_flags.file, "log (.slog or .h5)");

  auto [recover, recover_flags] =
      add_command(log, console, "recover", "Save the intact part of a damaged log", recover_file);
  add_required(recover, "file", recover_flags.file, "damaged log (.slog)");
  add_required(recover, "-o,--output", recover_flags.output, "new log to write (.slog)");

  auto [convert, convert_flags] =
      add_command(log, console, "convert",
                  "Convert a log to HDF5, CSV or MATLAB, or an HDF5 log to .slog", convert_file);
  add_required(convert, "file", convert_flags.file, "log (.slog or .h5)");
  add_required(convert, "-o,--output", convert_flags.output,
               "file to write (.h5, .csv, .mat; from an HDF5 log also .slog)");
  convert.add_flag("--complete-only", convert_flags.complete_only, "skip incomplete runs");
  add_mat_version(convert, convert_flags.mat_version);
}

}  // namespace stageid
