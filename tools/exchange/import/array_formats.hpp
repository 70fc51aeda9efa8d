#pragma once

#include <filesystem>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// The arrays of a file of another program: .mat, .npz, .csv, .txt, .dat, .h5, .hdf5, .unv, .uff.
/// @throws FileError, FormatError
/// @throws std::invalid_argument for another extension
ArrayList read_foreign_arrays(const std::filesystem::path& file);

}  // namespace stageid
