#include "acquisition/record/row_transpose.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>

namespace stageid {

namespace {

constexpr std::uint64_t kExponent = 0x7FF0000000000000U;
constexpr std::size_t kTileRows = 64;  // 64 rows of 25 words are 12.5 kB and fit the L1 cache

/// One column of one tile.
bool copy_column(const double* from, std::size_t row_words, std::size_t count,
                 double* to) noexcept {
  std::uint64_t not_finite = 0;
  for (std::size_t r = 0; r < count; ++r) {
    const double value = from[r * row_words];
    to[r] = value;
    not_finite |=
        static_cast<std::uint64_t>((std::bit_cast<std::uint64_t>(value) & kExponent) == kExponent);
  }
  return not_finite == 0;
}

}  // namespace

bool transpose_rows(const double* rows, std::size_t row_words, std::size_t count,
                    std::size_t column_count, double* columns, std::size_t column_stride) noexcept {
  bool finite = true;
  for (std::size_t first = 0; first < count; first += kTileRows) {
    const std::size_t tile = std::min(kTileRows, count - first);
    const double* from = rows + first * row_words;
    for (std::size_t c = 0; c < column_count; ++c)
      finite &= copy_column(from + c, row_words, tile, columns + c * column_stride + first);
  }
  return finite;
}

}  // namespace stageid
