#include "tools/fleet/fleet_jobs.hpp"

#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <chrono>
#include <map>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/version.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/fleet/fleet_time.hpp"

namespace stageid {
namespace {

std::vector<std::filesystem::path> matches_of(const std::string& pattern) {
  glob_t found{};
  std::vector<std::filesystem::path> files;
  if (::glob(pattern.c_str(), 0, nullptr, &found) == 0)
    files.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  ::globfree(&found);
  return files;
}

std::vector<FleetLog> logs_of_table(const std::filesystem::path& table) {
  const TextTable rows = read_text_table(table);
  const auto place = std::ranges::find(rows.names, "log");
  if (place == rows.names.end())
    throw FormatError(table, "1", "column 'log' is missing; add it to the first line");
  std::vector<FleetLog> logs;
  for (std::size_t r = 0; r < rows.rows.size(); ++r) {
    const std::vector<std::string>& fields = rows.rows[r];
    const auto fail = [&](const std::string& problem) {
      throw FormatError(table, fmt::format("{}", rows.lines[r]), problem);
    };
    const std::string& name_of_log = fields[place - rows.names.begin()];
    if (name_of_log.empty()) fail("the field 'log' is empty; name a log, or remove the line");
    FleetLog log;
    log.file = (table.parent_path() / name_of_log).lexically_normal();
    for (std::size_t c = 0; c < fields.size(); ++c) {
      const std::string& name = rows.names[c];
      if (name == "log") continue;
      if (name == "stage")
        log.stage = fields[c];
      else if (name == "time_utc")
        log.time_utc = fields[c];
      else if (!fields[c].empty())
        log.tags.emplace_back(name, fields[c]);
    }
    if (!log.time_utc.empty() && !days_of(log.time_utc))
      fail(fmt::format("got time_utc '{}'; expected 2026-05-04T12:34:56Z", log.time_utc));
    logs.push_back(std::move(log));
  }
  return logs;
}

}  // namespace

std::vector<FleetLog> fleet_logs(const FleetConfig& config, const Console& console) {
  std::vector<FleetLog> logs;
  std::vector<std::string> unmatched;
  std::map<std::filesystem::path, std::size_t> place;
  const auto add = [&](FleetLog log) {
    const auto [at, added] = place.emplace(log.file, logs.size());
    if (added)
      logs.push_back(std::move(log));
    else
      logs[at->second] = std::move(log);
  };
  for (const std::string& pattern : config.logs) {
    const std::vector<std::filesystem::path> files = matches_of(pattern);
    if (files.empty()) unmatched.push_back(pattern);
    for (const std::filesystem::path& file : files) add({file, "", "", {}});
  }
  if (!config.table.empty())
    for (FleetLog& log : logs_of_table(config.table)) add(std::move(log));
  if (logs.empty())
    fail_request("{}: no log matches; check 'logs' and 'table'", config.file.string());
  for (const std::string& pattern : unmatched)
    console.warning("{}: logs: no file matches '{}'; correct or remove the pattern",
                    config.file.string(), pattern);
  return logs;
}

std::string log_fingerprint(FleetStore& store, const std::filesystem::path& log) {
  std::error_code error;
  const auto size = static_cast<std::int64_t>(std::filesystem::file_size(log, error));
  if (error) return fingerprint_of_file(log);  // which tells the reason
  const auto changed_ns = static_cast<std::int64_t>(
      std::chrono::nanoseconds(std::filesystem::last_write_time(log).time_since_epoch()).count());
  const std::filesystem::path name = std::filesystem::absolute(log).lexically_normal();
  if (const auto known = store.log_fingerprint(name, size, changed_ns)) return *known;
  std::string fingerprint = fingerprint_of_file(log);
  store.note_log(name, size, changed_ns, fingerprint);
  return fingerprint;
}

std::string job_id(const std::string& log_fingerprint, const FleetConfig& config) {
  return fingerprint_of(fmt::format("{} {} {}", version(), log_fingerprint, config.identification));
}

std::filesystem::path job_folder(const std::filesystem::path& results, const std::string& job) {
  return results / job.substr(0, 2) / job.substr(0, kFolderDigits);
}

}  // namespace stageid
