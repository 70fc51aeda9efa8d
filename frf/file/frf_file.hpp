#pragma once

#include <filesystem>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Writes frf.h5 as in docs/formats.md, completely or not at all. @throws FileError
void write_frf(const std::filesystem::path& file, const FrfEstimate& frf);

/// @throws FileError, FormatError (check() failed; names the dataset)
FrfEstimate read_frf(const std::filesystem::path& file);

}  // namespace stageid
