#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace stageid {

/// One CAN FD frame with an 11-bit identifier on bus number `bus` of a transport.
struct CanFrame {
  std::uint16_t id = 0;
  std::uint8_t bus = 0;
  std::uint8_t length = 0;  ///< used bytes of `data`
  std::array<std::uint8_t, 64> data{};
  std::int64_t t_rx_ns = 0;  ///< CLOCK_MONOTONIC of the transport; 0 in frames to be sent
};

/// Smallest valid length of a CAN FD frame for `bytes` (64 at most).
std::size_t can_fd_length(std::size_t bytes) noexcept;

/// The first eight bytes of every frame:
///
///   0  u16  sequence   of the sample, or of the command
///   2  u8   kind       state, command or flags: see can_encoding.hpp
///   3  u8   run        low byte of the run's key; identifies frames of another run
///   4  u16  detail     time in microseconds, more bytes of the key, or a part number
///   6  u16  crc        CRC-16 over the identifier and all other bytes of the frame
struct CanHeader {
  std::uint16_t sequence = 0;
  std::uint8_t kind = 0;
  std::uint8_t run = 0;
  std::uint16_t detail = 0;
};
inline constexpr std::size_t kCanHeaderBytes = 8;

/// CRC-16/CCITT-FALSE (polynomial 0x1021, initial value 0xFFFF, not reflected) over the identifier
/// (low byte first) and the bytes of the frame except the CRC. CAN's own checksum detects neither a gateway
/// that changes the identifier nor corruption in a controller's memory.
std::uint16_t can_frame_crc(const CanFrame& frame) noexcept;

/// Writes the header in front of the payload; `payload_bytes` excludes the header.
void seal_can_frame(CanFrame& frame, const CanHeader& header, std::size_t payload_bytes) noexcept;

/// @returns false if the length does not match `payload_bytes` or the CRC is wrong.
[[nodiscard]] bool open_can_frame(const CanFrame& frame, std::size_t payload_bytes,
                                  CanHeader& header) noexcept;

/// Little-endian integers at a byte offset of a frame.
template <typename Integer>
void put_can(CanFrame& frame, std::size_t at, Integer value) noexcept {
  for (std::size_t i = 0; i < sizeof(Integer); ++i)
    frame.data[at + i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i));
}
template <typename Integer>
Integer get_can(const CanFrame& frame, std::size_t at) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(Integer); ++i)
    value |= static_cast<std::uint64_t>(frame.data[at + i]) << (8 * i);
  return static_cast<Integer>(value);
}

/// Conversion of a channel's value to int24:  count = round(value / si_per_count).
struct CanScale {
  double si_per_count = 1.0;
};
inline constexpr std::int32_t kCanLargestCount = 8388607;
inline constexpr std::size_t kCanCountBytes = 3;
/// range = 2^23 counts, so that a value at the range itself saturates by one count.
inline constexpr double kCanCountsOfRange = 8388608.0;
/// Whether all values up to `largest` fit into the range.
constexpr bool can_range_holds(double range, double largest) noexcept {
  return largest * kCanCountsOfRange <= range * kCanLargestCount;
}

enum class CanConversion : std::uint8_t { good, saturated, no_number };

/// Writes a value at an offset. Saturates; NaN and infinity become the "no value" code, -2^23.
CanConversion put_can_value(CanFrame& frame, std::size_t at, double value,
                            const CanScale& scale) noexcept;
/// @returns NaN for the "no value" code.
double get_can_value(const CanFrame& frame, std::size_t at, const CanScale& scale) noexcept;

}  // namespace stageid
