#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Reads a frequency response from another program's file without a map: Touchstone, CSV, universal file, or arrays
/// (.h5, .mat, .npz) with the names of docs/exchange.md. A new file format is added here.
/// @param output file that the response will be written to, for messages
/// @param notes receives what the user should know about the conversion
/// @throws FileError, FormatError; for arrays with unknown names it requests a map
FrfEstimate read_foreign_frf(const std::filesystem::path& file, const std::filesystem::path& output,
                             std::vector<std::string>& notes);

}  // namespace stageid
