#pragma once

#include <cstddef>

namespace stageid {

/// Copies a stretch of rows, as files hold them, into columns, as the DFT wants them:
///   columns[c * column_stride + r] = rows[r * row_words + c],   r < count, c < column_count.
/// Works in tiles that stay in the first-level cache.
/// @returns true if every value copied is finite.
bool transpose_rows(const double* rows, std::size_t row_words, std::size_t count,
                    std::size_t column_count, double* columns, std::size_t column_stride) noexcept;

}  // namespace stageid
