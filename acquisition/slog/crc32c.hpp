#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace stageid {

/// CRC-32C (Castagnoli: reflected polynomial 0x82F63B78, initial value and final xor 0xFFFFFFFF),
/// as in iSCSI and ext4. `previous` is the CRC of the preceding bytes, for streams in pieces.
/// Source: RFC 3720, appendix B.4 (test vectors).
///
/// With SSE 4.2, the processor's instruction is used on three interleaved streams, because its latency is three
/// cycles and its throughput one.
std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t previous = 0) noexcept;

/// The same by tables on every machine: the fallback, and the reference in the tests.
std::uint32_t crc32c_portable(std::span<const std::byte> bytes,
                              std::uint32_t previous = 0) noexcept;

}  // namespace stageid
