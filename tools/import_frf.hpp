#pragma once

#include "frf/frf_estimate.hpp"
#include "tools/import_map.hpp"
#include "tools/named_array.hpp"

namespace stageid {

/// The frequency response that a map finds among the arrays of a foreign file.
/// @throws FormatError naming the file and the array, or the map and the key that is missing or wrong.
FrfEstimate import_frf(const ArrayList& arrays, const ImportMap& map);

}  // namespace stageid
