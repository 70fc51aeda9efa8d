#include "hal/can/can_frame.hpp"

#include <cmath>
#include <limits>

namespace stageid {
namespace {

constexpr std::uint16_t kPolynomial = 0x1021;
constexpr std::size_t kCrcAt = 6;
constexpr std::int32_t kNoValue = -8388608;

constexpr std::array<std::uint16_t, 256> crc_table() {
  std::array<std::uint16_t, 256> table{};
  for (unsigned i = 0; i < 256; ++i) {
    unsigned crc = i << 8;
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & 0x8000U) != 0 ? (crc << 1) ^ kPolynomial : crc << 1;
    table[i] = static_cast<std::uint16_t>(crc);
  }
  return table;
}
constexpr std::array<std::uint16_t, 256> kTable = crc_table();

std::uint16_t add(std::uint16_t crc, std::uint8_t byte) noexcept {
  return static_cast<std::uint16_t>((crc << 8) ^ kTable[((crc >> 8) ^ byte) & 0xFFU]);
}

}  // namespace

std::size_t can_fd_length(std::size_t bytes) noexcept {
  if (bytes <= 8) return bytes;
  for (const std::size_t length : {12U, 16U, 20U, 24U, 32U, 48U})
    if (bytes <= length) return length;
  return 64;
}

std::uint16_t can_frame_crc(const CanFrame& frame) noexcept {
  std::uint16_t crc = 0xFFFF;
  crc = add(crc, static_cast<std::uint8_t>(frame.id));
  crc = add(crc, static_cast<std::uint8_t>(frame.id >> 8));
  for (std::size_t i = 0; i < frame.length; ++i)
    if (i != kCrcAt && i != kCrcAt + 1) crc = add(crc, frame.data[i]);
  return crc;
}

void seal_can_frame(CanFrame& frame, const CanHeader& header, std::size_t payload_bytes) noexcept {
  const std::size_t used = kCanHeaderBytes + payload_bytes;
  const std::size_t length = can_fd_length(used);
  for (std::size_t i = used; i < length; ++i) frame.data[i] = 0;
  frame.length = static_cast<std::uint8_t>(length);
  put_can(frame, 0, header.sequence);
  put_can(frame, 2, header.kind);
  put_can(frame, 3, header.run);
  put_can(frame, 4, header.detail);
  put_can(frame, kCrcAt, can_frame_crc(frame));
}

bool open_can_frame(const CanFrame& frame, std::size_t payload_bytes, CanHeader& header) noexcept {
  if (frame.length != can_fd_length(kCanHeaderBytes + payload_bytes)) return false;
  if (get_can<std::uint16_t>(frame, kCrcAt) != can_frame_crc(frame)) return false;
  header.sequence = get_can<std::uint16_t>(frame, 0);
  header.kind = get_can<std::uint8_t>(frame, 2);
  header.run = get_can<std::uint8_t>(frame, 3);
  header.detail = get_can<std::uint16_t>(frame, 4);
  return true;
}

CanConversion put_can_value(CanFrame& frame, std::size_t at, double value,
                            const CanScale& scale) noexcept {
  std::int32_t count = kNoValue;
  CanConversion conversion = CanConversion::no_number;
  if (std::isfinite(value)) {
    const double counts = std::nearbyint(value / scale.si_per_count);
    const bool inside = std::abs(counts) <= kCanLargestCount;
    conversion = inside ? CanConversion::good : CanConversion::saturated;
    count = inside ? static_cast<std::int32_t>(counts)
                   : (counts > 0.0 ? kCanLargestCount : -kCanLargestCount);
  }
  for (std::size_t i = 0; i < kCanCountBytes; ++i)
    frame.data[at + i] = static_cast<std::uint8_t>(static_cast<std::uint32_t>(count) >> (8 * i));
  return conversion;
}

double get_can_value(const CanFrame& frame, std::size_t at, const CanScale& scale) noexcept {
  const std::uint32_t raw = frame.data[at] | static_cast<std::uint32_t>(frame.data[at + 1]) << 8 |
                            static_cast<std::uint32_t>(frame.data[at + 2]) << 16;
  const std::int32_t count = static_cast<std::int32_t>(raw << 8) >> 8;  // sign extension
  return count == kNoValue ? std::numeric_limits<double>::quiet_NaN() : count * scale.si_per_count;
}

}  // namespace stageid
