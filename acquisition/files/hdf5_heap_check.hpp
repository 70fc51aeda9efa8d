#pragma once

#include <filesystem>

namespace stageid::hdf5 {

/// Looks at the global heaps of an HDF5 file, where texts of variable length stand.
///
/// HDF5 1.10 checks nothing there and runs out of its buffers, or forever, if one length is wrong.
/// Heaps stand where they were written, near the beginning or the end: the first and the last
/// megabytes of the file are searched.
/// @throws FormatError if a heap is damaged; FileError if the file cannot be read.
void check_global_heaps(const std::filesystem::path& file);

}  // namespace stageid::hdf5
