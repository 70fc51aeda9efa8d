#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace stageid {

/// One CAN FD frame with an 11-bit identifier, as it stands on bus number `bus` of a transport.
struct CanFrame {
  std::uint16_t id = 0;
  std::uint8_t bus = 0;
  std::uint8_t length = 0;  ///< bytes of `data` that count
  std::array<std::uint8_t, 64> data{};
  std::int64_t t_rx_ns = 0;  ///< CLOCK_MONOTONIC of the transport; 0 in frames to be sent
};

/// The smallest length a CAN FD frame can have that holds `bytes` (64 at most).
std::size_t can_fd_length(std::size_t bytes) noexcept;

/// What the first eight bytes of every frame of ours say:
///
///   0  u16  sequence   of the sample, or of the command
///   2  u8   kind       state, command or flags: see can_messages.hpp
///   3  u8   run        low byte of the run's key: frames of another run are foreign
///   4  u16  detail     time in microseconds, more of the key, or a number of a part
///   6  u16  crc        CRC-16 over the identifier and all other bytes of the frame
struct CanHeader {
  std::uint16_t sequence = 0;
  std::uint8_t kind = 0;
  std::uint8_t run = 0;
  std::uint16_t detail = 0;
};
inline constexpr std::size_t kCanHeaderBytes = 8;

/// CRC-16/CCITT-FALSE (polynomial 0x1021, initial value 0xFFFF, not reflected) over the identifier
/// (low byte first) and the bytes of the frame without its own two. CAN's checksum does not cover a
/// frame that a gateway gave another identifier, nor one that was damaged in a controller's memory.
std::uint16_t can_frame_crc(const CanFrame& frame) noexcept;

/// Writes the header in front of what stands behind it already; `payload_bytes` without the header.
void seal_can_frame(CanFrame& frame, const CanHeader& header, std::size_t payload_bytes) noexcept;

/// @returns false if the length is another than that of `payload_bytes`, or the CRC is wrong.
[[nodiscard]] bool open_can_frame(const CanFrame& frame, std::size_t payload_bytes,
                                  CanHeader& header) noexcept;

/// Little-endian integers at a place of a frame.
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

/// How a number of a channel becomes an int24:  count = round(value / si_per_count).
struct CanScale {
  double si_per_count = 1.0;
};
inline constexpr std::int32_t kCanLargestCount = 8388607;
inline constexpr std::size_t kCanCountBytes = 3;
/// range = 2^23 counts, so that a value at the range itself saturates by one count.
inline constexpr double kCanCountsOfRange = 8388608.0;
/// Whether every value up to `largest` is carried as it is.
constexpr bool can_range_holds(double range, double largest) noexcept {
  return largest * kCanCountsOfRange <= range * kCanLargestCount;
}

enum class CanConversion : std::uint8_t { good, saturated, no_number };

/// Puts a value at a place. Saturates; NaN and infinity become the one code that stands for no
/// value, -2^23.
CanConversion put_can_value(CanFrame& frame, std::size_t at, double value,
                            const CanScale& scale) noexcept;
/// @returns NaN for the code that stands for no value.
double get_can_value(const CanFrame& frame, std::size_t at, const CanScale& scale) noexcept;

}  // namespace stageid
