#pragma once

#include "tools/import_map.hpp"
#include "tools/named_array.hpp"

namespace stageid {

/// Writes the log that a map finds among the arrays of a foreign file, as .slog or .h5 by the ending of
/// `output`; whole or not at all. Every run holds transient and further periods, all whole.
/// @throws FormatError naming the file and the array, or the map and the key that is missing or wrong.
/// @throws std::invalid_argument for another ending. @throws FileError
void import_log(const ArrayList& arrays, const ImportMap& map, const std::filesystem::path& output);

}  // namespace stageid
