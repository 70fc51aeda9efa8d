#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "tools/fleet/fleet_store.hpp"

namespace stageid {

/// What `stageid watch` has tracked, for the store of a fleet.
struct WatchedLog {
  std::filesystem::path file;  ///< watch.h5
  std::string stage;
  std::string time_utc;  ///< start of the log; empty: that in the file
};

/// Stores the values at the end of each hour of recorded time, and the last ones. Values of the same stage, property and
/// time are replaced, so a log that has grown may be added again. One transaction.
/// @returns number of rows   @throws FileError, FormatError; std::invalid_argument without a time
std::size_t add_watched(FleetStore& store, const WatchedLog& log);

}  // namespace stageid
