#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

namespace stageid::report {

// Packing of bytes in the page: byte planes, deflate (zlib, RFC 1950), base64. The page unpacks them with the
// browser's own DecompressionStream: tools/report/js/decode.js.

/// RFC 4648, with padding.
std::string base64(std::span<const std::uint8_t> bytes);

/// Deflated, in base64. Equal bytes give equal text.
std::string packed(std::span<const std::uint8_t> bytes);

/// The lowest bytes of all numbers, then the next, ...: similar bytes are adjacent, and deflate codes each place
/// separately.
template <typename T>
std::vector<std::uint8_t> byte_planes(const std::vector<T>& values) {
  std::vector<std::uint8_t> bytes(values.size() * sizeof(T));
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::uint8_t raw[sizeof(T)];
    std::memcpy(raw, &values[i], sizeof(T));
    for (std::size_t plane = 0; plane < sizeof(T); ++plane)
      bytes[plane * values.size() + i] = raw[plane];
  }
  return bytes;
}

}  // namespace stageid::report
