#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stageid {

enum class FrameStatus : std::uint8_t {
  incomplete,  ///< more bytes are needed
  complete,
  broken  ///< not a request: close the connection (TCP), skip (RTU)
};

/// A request in a stream of bytes.
struct ModbusRequest {
  FrameStatus status = FrameStatus::incomplete;
  std::size_t bytes = 0;          ///< of the whole frame
  std::uint16_t transaction = 0;  ///< TCP only
  std::uint8_t unit = 0;
  std::span<const std::uint8_t> pdu;  ///< part of the bytes given
};

/// TCP: transaction, protocol 0, length of the rest, unit; 16 bits each except the unit.
/// Source: Modbus Messaging on TCP/IP Implementation Guide V1.0b, 3.1.3.
ModbusRequest parse_tcp_request(std::span<const std::uint8_t> bytes) noexcept;
std::vector<std::uint8_t> tcp_frame(std::uint16_t transaction, std::uint8_t unit,
                                    std::span<const std::uint8_t> pdu);

/// RTU: unit, PDU, CRC. The length follows from the function. Functions that answer_request() does not
/// support are assumed to have the length of a read.
ModbusRequest parse_rtu_request(std::span<const std::uint8_t> bytes) noexcept;
/// Finds the first request for `unit` on a shared line. Requests and replies of other units are skipped, and
/// unknown data byte by byte. `bytes` of the result includes the skipped bytes; if no request is complete, it
/// is their number alone.
ModbusRequest find_rtu_request(std::span<const std::uint8_t> bytes, std::uint8_t unit) noexcept;
std::vector<std::uint8_t> rtu_frame(std::uint8_t unit, std::span<const std::uint8_t> pdu);

/// x^16 + x^15 + x^2 + 1, reflected, initial value all ones; transmitted low byte first.
std::uint16_t modbus_crc16(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace stageid
