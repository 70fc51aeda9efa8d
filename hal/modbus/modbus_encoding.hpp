#pragma once

#include <bit>
#include <cstdint>
#include <ranges>
#include <span>
#include <type_traits>

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

/// Numbers in a part of the register map, by their addresses. @tparam Word of registers; const: to read only
template <typename Word>
class RegisterBlock {
 public:
  /// `words` are the registers from address `first` on, and must outlive the block.
  constexpr RegisterBlock(int first, std::span<Word> words) noexcept
      : first_(first), words_(words) {}

  constexpr std::uint32_t u32(int address) const noexcept {
    return (static_cast<std::uint32_t>(at(address)) << 16) | at(address + 1);
  }
  constexpr std::uint64_t u64(int address) const noexcept {
    return (static_cast<std::uint64_t>(u32(address)) << 32) | u32(address + 2);
  }
  constexpr std::int32_t i32(int address) const noexcept {
    return std::bit_cast<std::int32_t>(u32(address));
  }
  constexpr double f32(int address) const noexcept {
    return static_cast<double>(std::bit_cast<float>(u32(address)));
  }

  constexpr void set_u32(int address, std::uint32_t value) const noexcept {
    at(address) = static_cast<std::uint16_t>(value >> 16);
    at(address + 1) = static_cast<std::uint16_t>(value & 0xFFFFU);
  }
  constexpr void set_u64(int address, std::uint64_t value) const noexcept {
    set_u32(address, static_cast<std::uint32_t>(value >> 32));
    set_u32(address + 2, static_cast<std::uint32_t>(value & 0xFFFFFFFFU));
  }
  constexpr void set_i32(int address, std::int32_t value) const noexcept {
    set_u32(address, std::bit_cast<std::uint32_t>(value));
  }
  constexpr void set_f32(int address, float value) const noexcept {
    set_u32(address, std::bit_cast<std::uint32_t>(value));
  }

 private:
  constexpr Word& at(int address) const noexcept { return words_[address - first_]; }

  int first_;
  std::span<Word> words_;
};
template <typename Range>
RegisterBlock(int, Range&&)
    -> RegisterBlock<std::remove_reference_t<std::ranges::range_reference_t<Range>>>;

/// Whether to_counts() represents `value` without saturation: finite and within +-(2^31 - 1) counts.
bool fits_counts(double value, double si_per_count) noexcept;

/// Nearest count of `value`, ties to even, saturated at +-(2^31 - 1). NaN: 0.
std::int32_t to_counts(double value, double si_per_count) noexcept;

/// The smallest power of two whose 2^31 - 1 counts cover `range` (SI, > 0). With a power of two, a float32
/// is exact and scaling causes no rounding.
/// @throws std::invalid_argument if `range` is not within 1e-20 ... 1e20.
float count_scale(double range);

}  // namespace stageid
