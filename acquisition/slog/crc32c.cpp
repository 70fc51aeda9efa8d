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

constexpr std::size_t kStream = 4096;

/// The register x^0, bit 31, after `kStream` zero bytes: the factor that they multiply a register with.
constexpr std::uint32_t kShift = [] {
  std::uint32_t crc = 1U << 31;
  for (std::size_t i = 0; i < kStream; ++i) crc = (crc >> 8) ^ kByteTables[0][crc & 0xFFU];
  return crc;
}();

/// The register after `kStream` zero bytes: its product with kShift, modulo the polynomial.
std::uint32_t shifted(std::uint32_t crc) noexcept {
  std::uint32_t product = 0;
  for (std::uint32_t bits = kShift; bits != 0; bits <<= 1) {
    product ^= crc & (0U - (bits >> 31));
    crc = (crc >> 1) ^ (kPolynomial & (0U - (crc & 1U)));
  }
  return product;
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
  for (; size >= 3 * kStream; size -= 3 * kStream, at += 3 * kStream) {
    std::uint64_t crc1 = 0;
    std::uint64_t crc2 = 0;
    for (std::size_t i = 0; i < kStream; i += 8) {
      crc = _mm_crc32_u64(crc, load_word(at + i));
      crc1 = _mm_crc32_u64(crc1, load_word(at + kStream + i));
      crc2 = _mm_crc32_u64(crc2, load_word(at + 2 * kStream + i));
    }
    crc = shifted(static_cast<std::uint32_t>(crc)) ^ crc1;
    crc = shifted(static_cast<std::uint32_t>(crc)) ^ crc2;
  }
  for (; size >= 8; size -= 8, at += 8) crc = _mm_crc32_u64(crc, load_word(at));
  auto rest = static_cast<std::uint32_t>(crc);
  for (; size > 0; --size, ++at) rest = add_byte(rest, *at);
  return ~rest;
#else
  return crc32c_portable(bytes, previous);
#endif
}

}  // namespace stageid
