#pragma once

#include <filesystem>
#include <vector>

#include "tools/exchange/import/import_map.hpp"
#include "tools/exchange/import/import_runs.hpp"
#include "tools/exchange/import/import_summary.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// Writes the log that a map finds among the arrays of foreign files, as .slog or .h5 by the ending of
/// `output`; whole or not at all. Every run holds transient and further periods, all whole. Files are read
/// one after the other.
/// @throws FormatError naming the file and the array, or the map and the key that is missing or wrong.
/// @throws std::invalid_argument for another ending. @throws FileError
ImportSummary import_log(const std::vector<ForeignFile>& files, const ImportMap& map,
                         const std::filesystem::path& output);

}  // namespace stageid
