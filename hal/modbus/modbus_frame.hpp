#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stageid {

enum class FrameStatus : std::uint8_t {
  incomplete,  ///< wait for more
  complete,
  broken  ///< what stands here is no request: hang up (TCP), look further on (RTU)
};

/// A request as the server finds it in a stream of bytes.
struct ModbusRequest {
  FrameStatus status = FrameStatus::incomplete;
  std::size_t bytes = 0;          ///< of the whole frame
  std::uint16_t transaction = 0;  ///< TCP only
  std::uint8_t unit = 0;
  std::span<const std::uint8_t> pdu;  ///< part of the bytes given
};

/// TCP: transaction, protocol 0, length of the rest, unit; 16 bits each but the unit.
/// Source: Modbus Messaging on TCP/IP Implementation Guide V1.0b, 3.1.3.
ModbusRequest parse_tcp_request(std::span<const std::uint8_t> bytes) noexcept;
std::vector<std::uint8_t> tcp_frame(std::uint16_t transaction, std::uint8_t unit,
                                    std::span<const std::uint8_t> pdu);

/// RTU: unit, PDU, CRC. The length follows from the function; of functions that answer_request()
/// does not know it is taken to be that of a read.
ModbusRequest parse_rtu_request(std::span<const std::uint8_t> bytes) noexcept;
/// Finds the first request for `unit` on a line that others use too: skips their requests and
/// replies, and byte by byte what is neither. `bytes` of the result counts what was skipped as well;
/// unless a request is complete, only that.
ModbusRequest find_rtu_request(std::span<const std::uint8_t> bytes, std::uint8_t unit) noexcept;
std::vector<std::uint8_t> rtu_frame(std::uint8_t unit, std::span<const std::uint8_t> pdu);

/// x^16 + x^15 + x^2 + 1, reflected, starts with all ones; on the line low byte first.
std::uint16_t modbus_crc16(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace stageid
