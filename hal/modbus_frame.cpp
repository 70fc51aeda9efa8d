#include "hal/modbus_frame.hpp"

#include <algorithm>

#include "hal/modbus_pdu.hpp"

namespace stageid {
namespace {

constexpr std::size_t kTcpHeader = 7;  // unit included
constexpr std::size_t kCrcBytes = 2;
constexpr std::size_t kShortRequest = 8;     // unit, function, two words, CRC
constexpr std::size_t kWriteManyHeader = 7;  // up to the byte count
constexpr std::size_t kWriteAndReadHeader = 11;

/// Bytes of an RTU request; 0: more of it is needed to tell.
std::size_t rtu_request_bytes(std::span<const std::uint8_t> bytes) {
  std::size_t header = 0;
  if (bytes[1] == 15 || bytes[1] == 16) header = kWriteManyHeader;
  if (bytes[1] == 23) header = kWriteAndReadHeader;
  if (header == 0) return kShortRequest;
  return bytes.size() < header ? 0 : header + bytes[header - 1] + kCrcBytes;
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
  if (request.bytes == 0 || bytes.size() < request.bytes) return request;
  const std::span<const std::uint8_t> body = bytes.first(request.bytes - kCrcBytes);
  const std::uint16_t crc = modbus_crc16(body);
  const bool intact = bytes[request.bytes - 2] == (crc & 0xFFU) &&
                      bytes[request.bytes - 1] == static_cast<std::uint8_t>(crc >> 8);
  request.status = intact ? FrameStatus::complete : FrameStatus::broken;
  request.unit = bytes[0];
  request.pdu = body.subspan(1);
  return request;
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
