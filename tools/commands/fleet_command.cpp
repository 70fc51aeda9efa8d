#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/output_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/fleet/fleet_page.hpp"
#include "tools/fleet/fleet_pairing.hpp"
#include "tools/fleet/fleet_run.hpp"
#include "tools/fleet/fleet_time.hpp"
#include "tools/fleet/identify_log.hpp"
#include "tools/fleet/slurm.hpp"
#include "tools/fleet/watched_tracks.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

void require_time(const char* flag, const std::string& text) {
  if (!text.empty() && !days_of(text))
    fail_request("{}: got '{}'; expected 2026-05-04 or 2026-05-04T12:34:56Z", flag, text);
}

/// stageid fleet FLEET.yaml
struct FleetFlags {
  std::filesystem::path config;
  int workers = 0;
  int slurm_tasks = 0;  ///< 0: run here
};

/// Submits the jobs that are not done. @returns false if all are
bool submit_jobs(const FleetFlags& flags, const FleetConfig& config,
                 const std::vector<FleetLog>& logs, Console& console) {
  const std::size_t jobs = open_jobs(config, logs, console);
  if (jobs == 0) return false;
  const int tasks = static_cast<int>(std::min<std::size_t>(jobs, flags.slurm_tasks));
  const std::string number = submit_fleet(config, tasks, flags.workers);
  if (!is_database_url(config.store))
    console.message(
        "{}: this kind of store needs all tasks on the machine of its disk; for several machines, "
        "set 'store: postgresql://...'",
        shown_place(config.store));
  console.result(
      "Slurm job {}: {} share {}; 'squeue -j {}' shows them. When they have ended, run the command "
      "again without --slurm",
      number, counted(tasks, "task"), counted(jobs, "job"), number);
  console.result({{"slurm_job", number}, {"tasks", tasks}, {"open_jobs", jobs}});
  return true;
}

void run_jobs(const FleetFlags& flags, Console& console) {
  const FleetConfig config = load_fleet_config(flags.config);
  const std::vector<FleetLog> logs = fleet_logs(config, console);
  require_directory(config.results, fmt::format("change 'results' in {}", config.file.string()));
  if (flags.slurm_tasks > 0 && submit_jobs(flags, config, logs, console)) return;
  say_at_interrupt("finished jobs are stored; run the command again to continue");
  const FleetSummary summary = run_fleet(config, logs, flags.workers, console);
  FleetStore store(config.store, DatabaseAccess::write);
  pair_fleet(store);
  console.result("{}: {}: {} done before, {} done now, {} of them not trustworthy; {} failed",
                 shown_place(config.store), counted(summary.jobs, "job"), summary.done_before,
                 summary.done, summary.not_trustworthy, summary.failed);
  console.result({{"store", shown_place(config.store)},
                  {"jobs", summary.jobs},
                  {"done_before", summary.done_before},
                  {"done", summary.done},
                  {"not_trustworthy", summary.not_trustworthy},
                  {"failed", summary.failed}});
  if (summary.failed > 0)
    console.warning("{}: {} failed; remove the cause and run the command again",
                    shown_place(config.store), counted(summary.failed, "job"));
  console.exit_code = summary.failed > 0            ? kWorldFailed
                      : summary.not_trustworthy > 0 ? kNotTrustworthy
                                                    : kDone;
}

/// stageid fleet job FLEET.yaml LOG
struct FleetJobFlags {
  std::filesystem::path config;
  FleetLog log;
  std::vector<std::string> tags;
};

void run_job(const FleetJobFlags& flags, Console& console) {
  const FleetConfig config = load_fleet_config(flags.config);
  FleetLog log = flags.log;
  require_time("--time", log.time_utc);
  for (const std::string& tag : flags.tags) {
    const std::size_t at = tag.find('=');
    if (at == std::string::npos) fail_request("--tag: got '{}'; expected NAME=VALUE", tag);
    log.tags.emplace_back(tag.substr(0, at), tag.substr(at + 1));
  }
  require_readable(log.file);
  FleetStore store(config.store, DatabaseAccess::create);
  const std::string fingerprint = log_fingerprint(store, log.file);
  const std::string job = job_id(fingerprint, config);
  bool added = false;
  if (!is_done(store.state_of(job))) {
    const Identification identification = identify_log(config, log, fingerprint, console);
    added = store.add(identification);
    if (identification.verdict == IdentificationVerdict::not_trustworthy)
      console.exit_code = kNotTrustworthy;
  }
  console.result("{}: {}", job_folder(config.results, job).string(),
                 added ? "done" : "was done before");
  console.result({{"job", job}, {"added", added}});
}

/// stageid fleet add STORE watch.h5
struct FleetAddFlags {
  std::filesystem::path store;
  WatchedLog log;
};

void add_watched_log(const FleetAddFlags& flags, Console& console) {
  require_time("--time", flags.log.time_utc);
  require_readable(flags.log.file);
  FleetStore store(flags.store, DatabaseAccess::create);
  const std::size_t rows = add_watched(store, flags.log);
  console.result("{}: {} of stage '{}'", shown_place(flags.store), counted(rows, "watched value"),
                 flags.log.stage);
  console.result({{"stage", flags.log.stage}, {"values", rows}});
}

/// stageid fleet report STORE -o page.html
struct FleetReportFlags {
  std::filesystem::path store;
  FleetPageRequest request;
};

void report_fleet(const FleetReportFlags& flags, Console& console) {
  FleetStore store(flags.store, DatabaseAccess::write);
  require_ending(flags.request.output, "a page", {".html", ".htm"});
  require_writable(flags.request.output, {flags.store});
  require_time("--since", flags.request.since);
  require_time("--until", flags.request.until);
  pair_fleet(store);  // jobs of other processes
  write_text_file(flags.request.output, fleet_page(store, flags.request));
  console.result("wrote {}", flags.request.output.string());
  console.result({{"output", flags.request.output.string()}});
}

/// stageid fleet query STORE [SQL]
struct FleetQueryFlags {
  std::filesystem::path store;
  std::string sql = "stages";
  std::filesystem::path csv;
};

bool is_name(const std::string& text) {
  return text.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") == std::string::npos;
}

void require_table(Database& database, const std::string& name) {
  const std::vector<std::string> tables = database.tables();
  if (std::ranges::find(tables, name) == tables.end())
    fail_request("{}: unknown table '{}'; use one of {}, or an SQL statement", database.name(),
                 name, fmt::join(tables, ", "));
}

Json value_of(const Statement& row, int column) {
  const SqlKind kind = row.kind(column);
  if (kind == SqlKind::null) return {};
  if (kind == SqlKind::integer) return row.integer(column);
  if (kind == SqlKind::real) return row.number(column);
  return row.text(column);
}

void query_fleet(const FleetQueryFlags& flags, Console& console) {
  const FleetStore store(flags.store, DatabaseAccess::read);
  if (!flags.csv.empty()) {
    require_ending(flags.csv, "a table", {".csv"});
    require_writable(flags.csv, {flags.store});
  }
  if (is_name(flags.sql) && !flags.sql.starts_with("sqlite_"))
    require_table(store.database(), flags.sql);
  const auto rows =
      store.database().prepare(is_name(flags.sql) ? "SELECT * FROM " + flags.sql : flags.sql);
  if (!rows->changes_nothing() || rows->columns() == 0)
    fail_request("{}: expected a table or a SELECT statement", shown_place(flags.store));
  std::vector<std::vector<std::string>> table(1);
  for (int c = 0; c < rows->columns(); ++c) table[0].push_back(rows->name(c));
  Json list = Json::array();
  while (rows->step()) {
    table.emplace_back();
    Json object = Json::object();
    for (int c = 0; c < rows->columns(); ++c) {
      const Json value = value_of(*rows, c);
      const bool rounded = value.is_number_float() && flags.csv.empty();
      table.back().push_back(rounded ? fmt::format("{:.7g}", rows->number(c)) : rows->text(c));
      if (console.json) object[table[0][c]] = value;
    }
    if (console.json) list.push_back(std::move(object));
  }
  console.result({{"rows", list}});
  if (flags.csv.empty()) {
    for (const std::string& line : table_lines(table)) console.result(line);
    return;
  }
  std::string text;
  for (const std::vector<std::string>& row : table)
    for (std::size_t c = 0; c < row.size(); ++c)
      text += csv_field(row[c]) + (c + 1 < row.size() ? "," : "\n");
  write_text_file(flags.csv, text);
  console.result("wrote {}: {}", flags.csv.string(), counted(table.size() - 1, "row"));
}

}  // namespace

void fleet_command(CLI::App& app, Console& console) {
  CLI::App& fleet =
      add_command(app, "fleet", "Identify many logs, and follow their modes over time and stages");
  const auto flags = std::make_shared<FleetFlags>();
  // Before the subcommand runs: its surplus arguments end up here.
  fleet.parse_complete_callback([&fleet, flags] {
    if (!fleet.get_subcommands().empty() && !flags->config.empty())
      fail_request("unexpected argument '{}'; see 'stageid fleet --help'", flags->config.string());
    if (fleet.get_subcommands().empty() && flags->config.empty())
      fail_request("fleet: a fleet file or a subcommand is missing; see 'stageid fleet --help'");
  });
  fleet.final_callback([&console, flags] {
    if (!flags->config.empty()) run_jobs(*flags, console);
  });
  fleet.add_option("config", flags->config, "fleet file (.yaml)");
  add_setting(fleet, "--workers", flags->workers, "COUNT", "jobs at a time; 0: one per core",
              kNotNegative);
  add_value(fleet, "--slurm", flags->slurm_tasks, "TASKS",
            "submit this many tasks to Slurm, which share the jobs; sbatch reads its options "
            "from SBATCH_... in the environment",
            kPositive);

  auto [job, job_flags] =
      add_command(fleet, console, "job",
                  "Run one job, as 'stageid fleet' does for every log; for schedulers", run_job);
  add_required(job, "config", job_flags.config, "fleet file (.yaml)");
  add_required(job, "log", job_flags.log.file, "its log");
  add_value(job, "--stage", job_flags.log.stage, "NAME",
            "name of the stage; default: see 'stage_name'");
  add_value(job, "--time", job_flags.log.time_utc, "TIME",
            "time of the measurement, ISO 8601 in UTC; default: that in the log");
  add_value(job, "--tag", job_flags.tags, "NAME=VALUE", "NAME=VALUE; repeatable")
      ->allow_extra_args(false);

  auto [add, add_flags] = add_command(
      fleet, console, "add", "Add the hourly values of a watched log, from 'stageid watch -o'",
      add_watched_log);
  add_required(add, "store", add_flags.store, "store of a fleet (.db, or postgresql://...)");
  add_required(add, "tracks", add_flags.log.file, "watch.h5");
  add_value(add, "--stage", add_flags.log.stage, "NAME", "name of the stage")->required();
  add_value(add, "--time", add_flags.log.time_utc, "TIME",
            "start of the log, ISO 8601 in UTC; default: that in the log");

  auto [report, report_flags] = add_command(
      fleet, console, "report", "Write an interactive HTML page of a store", report_fleet);
  add_required(report, "store", report_flags.store, "store of a fleet (.db, or postgresql://...)");
  add_required(report, "-o,--output", report_flags.request.output, "page to write (.html)");
  add_value(report, "--stage", report_flags.request.stages, "NAME", "stages to show; default: all");
  add_value(report, "--since", report_flags.request.since, "TIME",
            "first time to show, such as 2026-05-04");
  add_value(report, "--until", report_flags.request.until, "TIME",
            "end of the time to show, not included");

  auto [query, query_flags] = add_command(
      fleet, console, "query", "Print a table of a store, or write it as CSV", query_fleet);
  add_required(query, "store", query_flags.store, "store of a fleet (.db, or postgresql://...)");
  add_setting(
      query, "sql", query_flags.sql, "TEXT",
      "stages | modes | stage_modes | identifications | outliers | watched | another table | an "
      "SQL statement, which cannot change the store");
  query.add_option("--csv", query_flags.csv, "file to write instead of printing");
}

}  // namespace stageid
