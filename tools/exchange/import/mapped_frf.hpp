#pragma once

#include "frf/response/frf_estimate.hpp"
#include "tools/exchange/arrays/named_array.hpp"
#include "tools/exchange/import/import_map.hpp"

namespace stageid {

/// The frequency response that a map selects from the arrays of a foreign file, not yet checked with check().
/// @throws FormatError naming the file and the array, or the map and the key that is missing or wrong.
FrfEstimate mapped_frf(const ArrayList& arrays, const ImportMap& map);

}  // namespace stageid
