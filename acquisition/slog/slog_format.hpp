#pragma once

// The native log, FILE.slog: an append-only sequence of blocks.
//
// All numbers are little-endian. Every block starts at a multiple of 64 bytes with this header:
//
//   offset  type     field
//        0  8 bytes  magic          89 53 4C 4F 47 0D 0A 1A  ("\x89SLOG\r\n\x1a")
//        8  uint16   type           1 log, 2 run_begin, 3 excitation, 4 samples, 5 run_end, 6 end
//       10  uint16   version        1
//       12  uint32   log_id         random, the same in every block of one file
//       12  uint32   log_id         random, the same in every block of a file
//       24  uint32   run            index of the run, 0, 1, 2, ... (0 in log and end blocks)
//       24  uint32   run            index of the run, 0, 1, 2, ... (0 in log and end blocks)
//       28  uint32   cols           8-byte words per row (samples), columns (excitation), otherwise 0
//       32  uint64   first_row      samples: index within the run of the block's first row, otherwise 0
//       40  uint32   rows           samples, excitation: rows, otherwise 0
//       48  int64    time_ns        when it was written, since 1970-01-01T00:00:00Z
//       48  int64    time_ns        time of writing, since 1970-01-01T00:00:00Z
//       60  uint32   header_crc     CRC-32C of bytes 0 .. 59
//
// The payload follows, padded with zero bytes to a multiple of 64. Payloads by type:
//
//   log         JSON: {"sample_rate_hz", "period_samples", "transient_periods", "excitation",
//               "actuators", "sensors": each {"names": [], "units": []}, "stamps": true if rows
//               have them, "metadata": {...}}.
//               The first block of a file; repeated before every run_begin, so that losing one is
//               harmless.
//   run_begin   JSON: {"realization", "experiment", "started_utc", "excitation_columns": [...]}.
//   excitation  float64, one period of the excitation, column by column, only the nonzero columns, which
//               run_begin lists. Absent if there are none.
//   samples     rows of `cols` words: actuators, sensors (float64, SI), then one uint64 status word:
//               bits 0-7 hal's Outcome, bit 8 marked (do not use), bit 9 irregular (jitter beyond
//               the limit), bits 32-63 lateness in ns. With "stamps", a uint64 stamp word stands before
//               it: bits 0-31 ns from the instant of the setpoint to the arrival of the measurement
//               (0: unknown), bit 32: bits 48-63 are the node's time in us, modulo 2^16.
//   run_end     JSON: {"realization", "experiment", "samples", "complete", "health": {"cycles",
//               "late", "missing", "marked", "irregular", "largest_lateness_ns", "seconds"}}. A run without run_end
//               was interrupted: incomplete.
//   end         JSON: {"exit_code", "message"}. The last block of a log that was closed properly; a
//               resumed log has several.
//
// Reader in numpy:
//
//   import numpy as np
//   head = np.dtype([('magic', 'S8'), ('type', '<u2'), ('version', '<u2'), ('log_id', '<u4'),
//       ('sequence', '<u8'), ('run', '<u4'), ('cols', '<u4'), ('first_row', '<u8'), ('rows', '<u4'),
//       ('bytes', '<u4'), ('time_ns', '<i8'), ('payload_crc', '<u4'), ('header_crc', '<u4')])
//   raw, at, runs = np.memmap('run.slog', np.uint8, 'r'), 0, {}
//   while at < raw.size:
//       h = raw[at:at + 64].view(head)[0]
//       payload = raw[at + 64:at + 64 + int(h['bytes'])]
//       if h['type'] == 4:
//           runs.setdefault(int(h['run']), []).append(payload.view('<f8').reshape(h['rows'], -1))
//       at += 64 + -(-int(h['bytes']) // 64) * 64
//   samples = {run: np.vstack(blocks) for run, blocks in runs.items()}  # last column: status word

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

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

constexpr SampleStamp unpack_stamp(std::uint64_t word) noexcept {
  SampleStamp stamp{static_cast<std::uint32_t>(word), {}};
  if (((word >> 32) & 1U) != 0) stamp.node_us = static_cast<std::uint16_t>(word >> 48);
  return stamp;
}

}  // namespace stageid
