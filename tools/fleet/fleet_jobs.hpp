#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tools/fleet/fleet_config.hpp"
#include "tools/fleet/fleet_store.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// One log of a fleet, with what the table says about it.
struct FleetLog {
  std::filesystem::path file;
  std::string stage;     ///< empty: see FleetConfig::stage_name
  std::string time_utc;  ///< empty: that in the log
  std::vector<std::pair<std::string, std::string>> tags;
};

/// The logs that match a pattern, in the order of their names, then those of the table; each once. That of the table
/// wins. Warns of a pattern without a log.
/// @throws FileError, FormatError "FILE:LINE: ..."; std::invalid_argument if there are none
std::vector<FleetLog> fleet_logs(const FleetConfig& config, const Console& console);

/// Fingerprint of a log. The store remembers those of logs that have not changed.
std::string log_fingerprint(FleetStore& store, const std::filesystem::path& log);

/// Identifies a job: the content of its log, what determines the result, and the version of the program.
std::string job_id(const std::string& log_fingerprint, const FleetConfig& config);

inline constexpr std::size_t kFolderDigits = 12;

/// The folder of the files of a job, named by the first digits of its identifier, below that of the results.
std::filesystem::path job_folder(const std::filesystem::path& results, const std::string& job);

}  // namespace stageid
