#pragma once

// The native log, FILE.slog: an append-only sequence of blocks, each a SlogBlockHeader and a payload. docs/formats.md
// describes fields and payloads, and has a reader in numpy.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "excitation/words/words.hpp"

namespace stageid {

static_assert(std::endian::native == std::endian::little,
              "native logs are little-endian and are mapped to memory unchanged");

enum class SlogBlockType : std::uint16_t { log = 1, run_begin, excitation, samples, run_end, end };
template <>
inline constexpr std::array kWords<SlogBlockType> = {
    "unknown", "log", "run_begin", "excitation", "samples", "run_end", "end"};

inline constexpr std::array<unsigned char, 8> kSlogMagic = {0x89, 'S',  'L',  'O',
                                                            'G',  '\r', '\n', 0x1A};
inline constexpr std::uint16_t kSlogVersion = 1;
inline constexpr std::size_t kSlogAlignment = 64;

/// Larger payloads are refused by writers and treated as damage by readers.
inline constexpr std::uint32_t kSlogLargestPayload = 1U << 30;

struct SlogBlockHeader {
  std::array<unsigned char, 8> magic = kSlogMagic;
  std::uint16_t type = 0;
  std::uint16_t version = kSlogVersion;
  std::uint32_t log_id = 0;
  std::uint64_t sequence = 0;
  std::uint32_t run = 0;
  std::uint32_t cols = 0;
  std::uint64_t first_row = 0;
  std::uint32_t rows = 0;
  std::uint32_t payload_bytes = 0;
  std::int64_t time_ns = 0;
  std::uint32_t payload_crc = 0;
  std::uint32_t header_crc = 0;

  bool is(SlogBlockType wanted) const noexcept {
    return type == static_cast<std::uint16_t>(wanted);
  }
};
static_assert(sizeof(SlogBlockHeader) == kSlogAlignment);

constexpr SlogBlockHeader slog_header(SlogBlockType type, std::uint32_t run) noexcept {
  SlogBlockHeader header;
  header.type = static_cast<std::uint16_t>(type);
  header.run = run;
  return header;
}

constexpr std::uint64_t slog_padded(std::uint64_t payload_bytes) noexcept {
  return (payload_bytes + kSlogAlignment - 1) / kSlogAlignment * kSlogAlignment;
}

/// Bytes of the whole block: header, payload, padding.
constexpr std::uint64_t slog_block_bytes(const SlogBlockHeader& header) noexcept {
  return kSlogAlignment + slog_padded(header.payload_bytes);
}

std::uint32_t slog_header_crc(const SlogBlockHeader& header) noexcept;

/// True if the magic and the header's own CRC are right. Does not check the other fields.
bool slog_header_intact(const SlogBlockHeader& header) noexcept;

/// One sample's status, stored in the last word of a row.
struct SampleStatus {
  std::uint8_t outcome = 0;  ///< hal's Outcome as a number
  bool marked = false;       ///< do not use this sample
  std::uint32_t lateness_ns = 0;
  bool irregular = false;  ///< its instant deviates by more than the jitter limit
  friend bool operator==(const SampleStatus&, const SampleStatus&) = default;
};

inline constexpr std::uint64_t kSlogMarkedBit = 1U << 8;
inline constexpr std::uint64_t kSlogIrregularBit = 1U << 9;

constexpr std::uint64_t pack_status(const SampleStatus& status) noexcept {
  return static_cast<std::uint64_t>(status.outcome) | (status.marked ? kSlogMarkedBit : 0U) |
         (status.irregular ? kSlogIrregularBit : 0U) |
         (static_cast<std::uint64_t>(status.lateness_ns) << 32);
}

constexpr SampleStatus unpack_status(std::uint64_t word) noexcept {
  return {static_cast<std::uint8_t>(word & 0xFFU), (word & kSlogMarkedBit) != 0,
          static_cast<std::uint32_t>(word >> 32), (word & kSlogIrregularBit) != 0};
}

/// Values of LogSamples::marked. An irregular sample has a good value at another instant.
inline constexpr std::uint8_t kBadMark = 1;
inline constexpr std::uint8_t kIrregularMark = 2;

/// @returns 0 for a good sample
constexpr std::uint8_t mark_of(const SampleStatus& status) noexcept {
  if (!status.marked) return 0;
  return status.irregular && status.outcome == 0 ? kIrregularMark : kBadMark;
}

/// Time stamps of one sample, stored in the word before the status.
struct SampleStamp {
  std::uint32_t arrival_ns = 0;          ///< after the instant of the setpoint; 0: unknown
  std::optional<std::uint16_t> node_us;  ///< the node's time, modulo 2^16
  friend bool operator==(const SampleStamp&, const SampleStamp&) = default;
};

constexpr std::uint64_t pack_stamp(const SampleStamp& stamp) noexcept {
  return stamp.arrival_ns |
         (stamp.node_us ? (std::uint64_t{1} << 32) | (std::uint64_t{*stamp.node_us} << 48) : 0U);
}

}  // namespace stageid
