#include "hal/modbus/modbus_request_frame.hpp"

#include <algorithm>

#include "hal/modbus/modbus_answer.hpp"

namespace stageid {
namespace {

constexpr std::size_t kTcpHeader = 7;  // unit included
constexpr std::size_t kCrcBytes = 2;
constexpr std::size_t kShortRequest = 8;     // unit, function, two words, CRC
constexpr std::size_t kExceptionReply = 5;   // unit, function, code, CRC
constexpr std::size_t kReplyHeader = 3;      // unit, function, byte count
constexpr std::size_t kWriteManyHeader = 7;  // up to the byte count
constexpr std::size_t kWriteAndReadHeader = 11;

/// Bytes of an RTU request; 0: not yet known, more bytes are needed.
std::size_t rtu_request_bytes(std::span<const std::uint8_t> bytes) {
  std::size_t header = 0;
  if (bytes[1] == 15 || bytes[1] == 16) header = kWriteManyHeader;
  if (bytes[1] == 23) header = kWriteAndReadHeader;
  if (header == 0) return kShortRequest;
  return bytes.size() < header ? 0 : header + bytes[header - 1] + kCrcBytes;
}

/// Bytes of an RTU reply of another unit; 0: not a known reply.
std::size_t rtu_reply_bytes(std::span<const std::uint8_t> bytes) {
  if ((bytes[1] & 0x80U) != 0) return kExceptionReply;
  if ((bytes[1] >= 1 && bytes[1] <= 4) || bytes[1] == 23)
    return bytes.size() < 3 ? 3 : kReplyHeader + bytes[2] + kCrcBytes;
  return bytes[1] == 5 || bytes[1] == 6 || bytes[1] == 15 || bytes[1] == 16 ? kShortRequest : 0;
}

/// Whether `length` bytes have arrived with a correct CRC. A length of 0 is not yet known.
FrameStatus rtu_status(std::span<const std::uint8_t> bytes, std::size_t length) {
  if (length == 0 || bytes.size() < length) return FrameStatus::incomplete;
  const std::uint16_t crc = modbus_crc16(bytes.first(length - kCrcBytes));
  const bool intact = bytes[length - 2] == (crc & 0xFFU) &&
                      bytes[length - 1] == static_cast<std::uint8_t>(crc >> 8);
  return intact ? FrameStatus::complete : FrameStatus::broken;
}

void put_word(std::vector<std::uint8_t>& frame, std::size_t at, std::size_t word) {
  frame[at] = static_cast<std::uint8_t>(word >> 8);
  frame[at + 1] = static_cast<std::uint8_t>(word & 0xFFU);
}

}  // namespace

ModbusRequest parse_tcp_request(std::span<const std::uint8_t> bytes) noexcept {
  ModbusRequest request;
  if (bytes.size() < kTcpHeader) return request;
  const std::size_t rest = static_cast<std::size_t>((bytes[4] << 8) | bytes[5]);
  if (bytes[2] != 0 || bytes[3] != 0 || rest < 2 || rest > kLargestPdu + 1) {
    request.status = FrameStatus::broken;
    return request;
  }
  request.bytes = kTcpHeader - 1 + rest;
  if (bytes.size() < request.bytes) return request;
  request.status = FrameStatus::complete;
  request.transaction = static_cast<std::uint16_t>((bytes[0] << 8) | bytes[1]);
  request.unit = bytes[6];
  request.pdu = bytes.subspan(kTcpHeader, rest - 1);
  return request;
}

std::vector<std::uint8_t> tcp_frame(std::uint16_t transaction, std::uint8_t unit,
                                    std::span<const std::uint8_t> pdu) {
  const std::size_t rest = pdu.size() + 1;
  std::vector<std::uint8_t> frame(kTcpHeader + pdu.size());
  put_word(frame, 0, transaction);
  put_word(frame, 4, rest);
  frame[6] = unit;
  std::copy(pdu.begin(), pdu.end(), frame.begin() + kTcpHeader);
  return frame;
}

ModbusRequest parse_rtu_request(std::span<const std::uint8_t> bytes) noexcept {
  ModbusRequest request;
  if (bytes.size() < 2) return request;
  request.bytes = rtu_request_bytes(bytes);
  request.status = rtu_status(bytes, request.bytes);
  if (request.status == FrameStatus::incomplete) return request;
  request.unit = bytes[0];
  request.pdu = bytes.subspan(1, request.bytes - 1 - kCrcBytes);
  return request;
}

ModbusRequest find_rtu_request(std::span<const std::uint8_t> bytes, std::uint8_t unit) noexcept {
  ModbusRequest none;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::span<const std::uint8_t> rest = bytes.subspan(at);
    ModbusRequest request = parse_rtu_request(rest);
    none.bytes = at;
    if (request.status == FrameStatus::complete && request.unit == unit) {
      request.bytes += at;
      return request;
    }
    if (request.status == FrameStatus::incomplete && (rest.size() < 2 || rest[0] == unit))
      return none;
    if (request.status == FrameStatus::complete) {
      at += request.bytes;
      continue;
    }
    const std::size_t reply = rest[0] == unit ? 0 : rtu_reply_bytes(rest);
    const FrameStatus as_reply = reply == 0 ? FrameStatus::broken : rtu_status(rest, reply);
    const bool more_needed =
        request.status == FrameStatus::incomplete || as_reply == FrameStatus::incomplete;
    if (as_reply != FrameStatus::complete && more_needed) return none;
    at += as_reply == FrameStatus::complete ? reply : 1;
  }
  none.bytes = bytes.size();
  return none;
}

std::vector<std::uint8_t> rtu_frame(std::uint8_t unit, std::span<const std::uint8_t> pdu) {
  std::vector<std::uint8_t> frame(1 + pdu.size() + kCrcBytes);
  frame[0] = unit;
  std::copy(pdu.begin(), pdu.end(), frame.begin() + 1);
  const std::uint16_t crc = modbus_crc16(std::span(frame).first(frame.size() - kCrcBytes));
  frame[frame.size() - 2] = static_cast<std::uint8_t>(crc & 0xFFU);
  frame[frame.size() - 1] = static_cast<std::uint8_t>(crc >> 8);
  return frame;
}

std::uint16_t modbus_crc16(std::span<const std::uint8_t> bytes) noexcept {
  unsigned crc = 0xFFFFU;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1U) != 0 ? (crc >> 1) ^ 0xA001U : crc >> 1;
  }
  return static_cast<std::uint16_t>(crc);
}

}  // namespace stageid
