#pragma once

#include "frf/response/frf_estimate.hpp"
#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// The content of frf.h5 for a frequency response, with the same names: docs/formats.md.
/// @param beside a file next to which a temporary file may be created
/// @throws FileError
ArrayList arrays_of_frf(const FrfEstimate& frf, const std::filesystem::path& beside);

/// The reverse, from .npz ("inputs@unit") or .mat (inputs_unit, a x b x N) files written by stageid.
/// @param beside as above
/// @throws FormatError naming the file of `list`.
FrfEstimate frf_of_arrays(const ArrayList& list, const std::filesystem::path& beside);

/// The place of the channel with this name, which is appended if there is none.
Eigen::Index place_in(ChannelList& channels, const std::string& name, const std::string& unit);

/// True if the arrays have the format of a stageid frequency response.
bool holds_frf(const ArrayList& list);

}  // namespace stageid
