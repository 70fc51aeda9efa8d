#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frf/response/frf_estimate.hpp"
#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// The arrays of a file of another program: .mat, .npz, .csv, .txt, .dat, .h5, .hdf5, .unv, .uff.
/// @throws FileError, FormatError
/// @throws std::invalid_argument for another extension
ArrayList read_foreign_arrays(const std::filesystem::path& file);

/// Reads a frequency response from another program's file without a map: Touchstone, CSV, universal file, or arrays
/// (.h5, .mat, .npz) with the names of docs/exchange.md. A new file format is added here.
/// @param output file that the response will be written to, for messages
/// @param notes receives what the user should know about the conversion
/// @throws FileError, FormatError; for arrays with unknown names it requests a map
FrfEstimate read_foreign_frf(const std::filesystem::path& file, const std::filesystem::path& output,
                             std::vector<std::string>& notes);

}  // namespace stageid
