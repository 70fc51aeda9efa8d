#pragma once

#include "acquisition/files/hdf5_file.hpp"

namespace stageid::hdf5 {

/// Visits every object, attribute and text of a file, so that a crash of HDF5 on a damaged one occurs here.
/// @throws FormatError if the file refers to other files (external links, external storage, virtual datasets), which
/// would show their contents as measured data, contains a
/// group within itself, or has more than 20000 objects.
void survey(const Hdf5File& file);

}  // namespace stageid::hdf5
