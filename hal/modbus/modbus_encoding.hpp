#pragma once

#include <bit>
#include <cstdint>
#include <span>

namespace stageid {

/// Largest absolute count of a 32-bit setpoint or measurement.
inline constexpr double kLargestModbusCount = 2147483647.0;

// Encoding of numbers in Modbus registers, the more significant word first:
//
//   uint32 = r[0] 2^16 + r[1];   uint64 = uint32(r) 2^32 + uint32(r + 2)
//   int32, float32: the same 32 bits, two's complement and IEEE 754
//
// libmodbus' own helpers are not used: setting and getting a float disagree in Debian's 3.1.6, and
// between versions of the library.

constexpr void put_u32(std::span<std::uint16_t, 2> r, std::uint32_t value) noexcept {
  r[0] = static_cast<std::uint16_t>(value >> 16);
  r[1] = static_cast<std::uint16_t>(value & 0xFFFFU);
}
constexpr std::uint32_t get_u32(std::span<const std::uint16_t, 2> r) noexcept {
  return (static_cast<std::uint32_t>(r[0]) << 16) | r[1];
}

constexpr void put_u64(std::span<std::uint16_t, 4> r, std::uint64_t value) noexcept {
  put_u32(r.first<2>(), static_cast<std::uint32_t>(value >> 32));
  put_u32(r.last<2>(), static_cast<std::uint32_t>(value & 0xFFFFFFFFU));
}
constexpr std::uint64_t get_u64(std::span<const std::uint16_t, 4> r) noexcept {
  return (static_cast<std::uint64_t>(get_u32(r.first<2>())) << 32) | get_u32(r.last<2>());
}

constexpr void put_i32(std::span<std::uint16_t, 2> r, std::int32_t value) noexcept {
  put_u32(r, std::bit_cast<std::uint32_t>(value));
}
constexpr std::int32_t get_i32(std::span<const std::uint16_t, 2> r) noexcept {
  return std::bit_cast<std::int32_t>(get_u32(r));
}

constexpr void put_f32(std::span<std::uint16_t, 2> r, float value) noexcept {
  put_u32(r, std::bit_cast<std::uint32_t>(value));
}
constexpr float get_f32(std::span<const std::uint16_t, 2> r) noexcept {
  return std::bit_cast<float>(get_u32(r));
}

/// Whether to_counts() represents `value` without saturation: finite and within +-(2^31 - 1) counts.
bool fits_counts(double value, double si_per_count) noexcept;

/// Nearest count of `value`, ties to even, saturated at +-(2^31 - 1). NaN: 0.
std::int32_t to_counts(double value, double si_per_count) noexcept;

/// The smallest power of two whose 2^31 - 1 counts cover `range` (SI, > 0). With a power of two, a float32
/// is exact and scaling causes no rounding.
/// @throws std::invalid_argument if `range` is not within 1e-20 ... 1e20.
float count_scale(double range);

}  // namespace stageid
