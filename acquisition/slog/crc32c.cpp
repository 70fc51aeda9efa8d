#include "acquisition/slog/crc32c.hpp"

#include <array>
#include <cstring>

#ifdef __SSE4_2__
#include <nmmintrin.h>
#endif

namespace stageid {

namespace {

constexpr std::uint32_t kPolynomial = 0x82F63B78U;

using ByteTables = std::array<std::array<std::uint32_t, 256>, 8>;

/// tables[k][b]: contribution of byte b followed by k more bytes.
constexpr ByteTables make_byte_tables() {
  ByteTables tables{};
  for (std::uint32_t b = 0; b < 256; ++b) {
    std::uint32_t crc = b;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? kPolynomial : 0U);
    tables[0][b] = crc;
  }
  for (std::size_t k = 1; k < tables.size(); ++k) {
    for (std::size_t b = 0; b < 256; ++b) {
      const std::uint32_t before = tables[k - 1][b];
      tables[k][b] = (before >> 8) ^ tables[0][before & 0xFFU];
    }
  }
  return tables;
}

constexpr ByteTables kByteTables = make_byte_tables();

std::uint32_t add_byte(std::uint32_t crc, std::byte byte) noexcept {
  return (crc >> 8) ^ kByteTables[0][(crc ^ std::to_integer<std::uint32_t>(byte)) & 0xFFU];
}

std::uint64_t load_word(const std::byte* bytes) noexcept {
  std::uint64_t word = 0;
  std::memcpy(&word, bytes, sizeof word);
  return word;
}

#ifdef __SSE4_2__

/// A linear map on 32-bit CRC registers: column i is the image of bit i.
using RegisterMap = std::array<std::uint32_t, 32>;

constexpr std::uint32_t map_bits(const RegisterMap& map, std::uint32_t value) {
  std::uint32_t image = 0;
  for (std::size_t bit = 0; bit < 32; ++bit) {
    if (((value >> bit) & 1U) != 0) image ^= map[bit];
  }
  return image;
}

using ShiftTables = std::array<std::array<std::uint32_t, 256>, 4>;

/// Tables of the map that `length` zero bytes (a power of two) apply to a CRC register. It is the map of one zero
/// byte, squared log2(length) times.
constexpr ShiftTables make_shift_tables(std::size_t length) {
  RegisterMap map{};
  for (std::size_t bit = 0; bit < 32; ++bit) {
    const std::uint32_t value = 1U << bit;
    map[bit] = (value >> 8) ^ kByteTables[0][value & 0xFFU];
  }
  for (; length > 1; length /= 2) {
    RegisterMap square{};
    for (std::size_t bit = 0; bit < 32; ++bit) square[bit] = map_bits(map, map[bit]);
    map = square;
  }
  ShiftTables tables{};
  for (std::size_t k = 0; k < 4; ++k) {
    for (std::uint32_t b = 0; b < 256; ++b) tables[k][b] = map_bits(map, b << (8 * k));
  }
  return tables;
}

constexpr std::size_t kLongStream = 2048;
constexpr std::size_t kShortStream = 256;
constexpr ShiftTables kLongShift = make_shift_tables(kLongStream);
constexpr ShiftTables kShortShift = make_shift_tables(kShortStream);

std::uint32_t shift(const ShiftTables& tables, std::uint64_t crc) noexcept {
  return tables[0][crc & 0xFFU] ^ tables[1][(crc >> 8) & 0xFFU] ^ tables[2][(crc >> 16) & 0xFFU] ^
         tables[3][(crc >> 24) & 0xFFU];
}

/// Removes whole triples of `stream` bytes from the front.
template <std::size_t stream>
void add_triples(const ShiftTables& tables, const std::byte*& at, std::size_t& size,
                 std::uint64_t& crc) noexcept {
  while (size >= 3 * stream) {
    std::uint64_t crc1 = 0;
    std::uint64_t crc2 = 0;
    for (std::size_t i = 0; i < stream; i += 8) {
      crc = _mm_crc32_u64(crc, load_word(at + i));
      crc1 = _mm_crc32_u64(crc1, load_word(at + stream + i));
      crc2 = _mm_crc32_u64(crc2, load_word(at + 2 * stream + i));
    }
    crc = shift(tables, crc) ^ crc1;
    crc = shift(tables, crc) ^ crc2;
    at += 3 * stream;
    size -= 3 * stream;
  }
}

#endif

}  // namespace

std::uint32_t crc32c_portable(std::span<const std::byte> bytes, std::uint32_t previous) noexcept {
  std::uint32_t crc = ~previous;
  const std::byte* at = bytes.data();
  std::size_t size = bytes.size();
  for (; size >= 8; size -= 8, at += 8) {
    const std::uint64_t word = load_word(at) ^ crc;
    crc = 0;
    for (std::size_t k = 0; k < 8; ++k) crc ^= kByteTables[7 - k][(word >> (8 * k)) & 0xFFU];
  }
  for (; size > 0; --size, ++at) crc = add_byte(crc, *at);
  return ~crc;
}

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t previous) noexcept {
#ifdef __SSE4_2__
  std::uint64_t crc = ~previous;
  const std::byte* at = bytes.data();
  std::size_t size = bytes.size();
  add_triples<kLongStream>(kLongShift, at, size, crc);
  add_triples<kShortStream>(kShortShift, at, size, crc);
  for (; size >= 8; size -= 8, at += 8) crc = _mm_crc32_u64(crc, load_word(at));
  auto rest = static_cast<std::uint32_t>(crc);
  for (; size > 0; --size, ++at) rest = add_byte(rest, *at);
  return ~rest;
#else
  return crc32c_portable(bytes, previous);
#endif
}

}  // namespace stageid
