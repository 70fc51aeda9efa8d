#pragma once

#include <filesystem>

namespace stageid::hdf5 {

/// Checks the global heaps of an HDF5 file, which contain texts of variable length.
///
/// HDF5 1.10 does not check them: a wrong length makes it read out of bounds or loop forever. Heaps are
/// written near the beginning or the end, so only the first and the last megabytes are searched.
/// @throws FormatError if a heap is damaged; FileError if the file cannot be read.
void check_global_heaps(const std::filesystem::path& file);

}  // namespace stageid::hdf5
