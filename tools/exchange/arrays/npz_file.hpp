#pragma once

#include <filesystem>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// Writes arrays for numpy.load(): an uncompressed zip of .npy files. Equal contents give equal bytes.
/// Names are kept ("modes/damping_ratio", "inputs@unit"); texts are arrays of dtype U, single
/// values arrays of shape ().
/// @throws FileError
void write_npz(const std::filesystem::path& file, const ArrayList& list);

/// Reads .npz, stored or deflated: float16 to float64, integers, bool, complex, text (U and S), either byte
/// order, C and Fortran order. Object arrays are refused: they may contain code.
/// @throws FileError, FormatError naming the member.
ArrayList read_npz(const std::filesystem::path& file);

}  // namespace stageid
