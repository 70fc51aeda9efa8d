#pragma once

#include "frf/response/frf_estimate.hpp"
#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// Everything that frf.h5 holds of a frequency response, under the same names: docs/formats.md.
/// @param beside a file next to which a temporary one may stand for a moment
/// @throws FileError
ArrayList arrays_of_frf(const FrfEstimate& frf, const std::filesystem::path& beside);

/// The reverse, from .npz ("inputs@unit") or .mat (inputs_unit, a x b x N) of ours.
/// @param beside as above
/// @throws FormatError naming the file of `list`.
FrfEstimate frf_of_arrays(const ArrayList& list, const std::filesystem::path& beside);

/// True if the arrays say that they are a frequency response of ours.
bool holds_frf(const ArrayList& list);

}  // namespace stageid
