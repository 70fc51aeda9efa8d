#pragma once

#include <filesystem>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Writes frf.h5 as in docs/formats.md, completely or not at all. @throws FileError
void write_frf(const std::filesystem::path& file, const FrfEstimate& frf);

/// @param team processes that divide the channels, see ChannelData; null: one. All channels are read if the file has
/// covariances, which connect them.
/// @throws FileError, FormatError (check() failed; names the dataset)
FrfEstimate read_frf(const std::filesystem::path& file, const Team* team = nullptr);

}  // namespace stageid
