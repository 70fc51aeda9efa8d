#pragma once

#include <cstddef>

namespace stageid {

/// Copies rows, the order of files, into columns, the order of the DFT:
///   columns[c * column_stride + r] = rows[r * row_words + c],   r < count, c < column_count.
/// Works in tiles that fit the first-level cache.
/// @returns true if every copied value is finite.
bool transpose_rows(const double* rows, std::size_t row_words, std::size_t count,
                    std::size_t column_count, double* columns, std::size_t column_stride) noexcept;

}  // namespace stageid
