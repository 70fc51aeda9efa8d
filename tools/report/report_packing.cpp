#include "tools/report/report_packing.hpp"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <new>

namespace stageid::report {

static_assert(std::endian::native == std::endian::little, "the page expects little-endian numbers");

std::string base64(std::span<const std::uint8_t> bytes) {
  static constexpr char alphabet[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t there = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = std::uint32_t{bytes[i]} << 16;
    if (there > 1) word |= std::uint32_t{bytes[i + 1]} << 8;
    if (there > 2) word |= std::uint32_t{bytes[i + 2]};
    for (std::size_t j = 0; j < 4; ++j)
      text += j <= there ? alphabet[(word >> (18 - 6 * j)) & 63] : '=';
  }
  return text;
}

std::string packed(std::span<const std::uint8_t> bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::vector<std::uint8_t> out(size);
  // With the bound as size, only memory allocation can fail.
  if (compress2(out.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()),
                Z_BEST_COMPRESSION) != Z_OK)
    throw std::bad_alloc();
  return base64({out.data(), size});
}

}  // namespace stageid::report
