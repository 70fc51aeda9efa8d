#pragma once

#include "tools/exchange/arrays/named_array.hpp"
#include "tools/exchange/import/import_map.hpp"

namespace stageid {

/// The sample rate of a log: that of the map, else that of the file. Sources in a file: the abscissas of the arrays
/// that the map names (universal files), a number or an attribute called sample_rate_hz, fs, dt or similar, or an
/// evenly spaced time axis called t or time.
/// @throws FormatError if the two differ, or neither is known
double sample_rate_of(const ArrayList& arrays, const ImportMap& map);

}  // namespace stageid
