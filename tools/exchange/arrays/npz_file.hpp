#pragma once

#include <filesystem>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// Writes arrays for numpy.load(): an uncompressed zip of .npy files; equal content gives equal bytes. Names are
/// unchanged ("modes/damping_ratio", "inputs@unit"). Texts are arrays of dtype U, single values arrays of shape ().
/// @throws FileError, std::invalid_argument if an array or the file has 4 GiB or more.
void write_npz(const std::filesystem::path& file, const ArrayList& list);

/// Reads .npz, stored or deflated: float16 to float64, integers, bool, complex, text (U and S), either byte order, C
/// and Fortran order. Object arrays are rejected, because they contain code.
/// @throws FileError, FormatError naming the member.
ArrayList read_npz(const std::filesystem::path& file);

}  // namespace stageid
