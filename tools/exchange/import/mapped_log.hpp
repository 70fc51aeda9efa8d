#pragma once

#include <filesystem>
#include <vector>

#include "tools/exchange/import/import_map.hpp"
#include "tools/exchange/import/import_runs.hpp"
#include "tools/exchange/import/import_summary.hpp"

namespace stageid {

/// Writes the log that a map selects from the arrays of foreign files, atomically, as .slog or .h5 by the extension of
/// `output`. Every run consists of whole periods: the transient ones and at least one more. Files are read one after
/// another.
/// @throws FormatError naming the file and the array, or the map and the key that is missing or wrong.
/// @throws std::invalid_argument for another extension. @throws FileError
ImportSummary import_mapped_log(const std::vector<ForeignFile>& files, const ImportMap& map,
                                const std::filesystem::path& output);

}  // namespace stageid
