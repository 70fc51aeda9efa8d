#include "hal/modbus/modbus_pdu.hpp"

#include <algorithm>
#include <array>

namespace stageid {
namespace {

constexpr std::size_t kMostRead = 125;
constexpr std::size_t kMostWritten = 123;
constexpr std::size_t kMostWrittenAndRead = 121;
constexpr std::uint8_t kReadHolding = 3;
constexpr std::uint8_t kReadInput = 4;
constexpr std::uint8_t kWriteOne = 6;
constexpr std::uint8_t kWriteMany = 16;
constexpr std::uint8_t kWriteAndRead = 23;

using Request = std::span<const std::uint8_t>;
using Reply = std::span<std::uint8_t, kLargestPdu>;

std::uint16_t word(Request request, std::size_t at) {
  return static_cast<std::uint16_t>((request[at] << 8) | request[at + 1]);
}

/// Reads `count` registers into a reply that starts with function and byte count.
ModbusException read_into(ModbusRegisters& registers, int first, std::size_t count, Reply reply,
                          std::size_t& bytes) {
  if (count < 1 || count > kMostRead) return ModbusException::illegal_value;
  std::array<std::uint16_t, kMostRead> values{};
  const ModbusException refused = registers.read(first, std::span(values).first(count));
  if (refused != ModbusException::none) return refused;
  reply[1] = static_cast<std::uint8_t>(2 * count);
  bytes = 2;
  for (std::size_t i = 0; i < count; ++i) {
    reply[bytes++] = static_cast<std::uint8_t>(values[i] >> 8);
    reply[bytes++] = static_cast<std::uint8_t>(values[i] & 0xFFU);
  }
  return ModbusException::none;
}

/// Writes the registers whose data follow their byte count at byte `at`.
ModbusException write_from(ModbusRegisters& registers, int first, std::size_t count,
                           std::size_t most, Request request, std::size_t at) {
  if (count < 1 || count > most || request[at - 1] != 2 * count || request.size() != at + 2 * count)
    return ModbusException::illegal_value;
  std::array<std::uint16_t, kMostWritten> values{};
  for (std::size_t i = 0; i < count; ++i) values[i] = word(request, at + 2 * i);
  return registers.write(first, std::span(values).first(count));
}

ModbusException write_many(Request request, ModbusRegisters& registers, Reply reply,
                           std::size_t& bytes) {
  if (request.size() < 6) return ModbusException::illegal_value;
  const ModbusException refused =
      write_from(registers, word(request, 1), word(request, 3), kMostWritten, request, 6);
  std::copy_n(request.begin() + 1, 4, reply.begin() + 1);
  bytes = 5;
  return refused;
}

ModbusException write_one(Request request, ModbusRegisters& registers, Reply reply,
                          std::size_t& bytes) {
  if (request.size() != 5) return ModbusException::illegal_value;
  const std::array<std::uint16_t, 1> value = {word(request, 3)};
  std::copy_n(request.begin() + 1, 4, reply.begin() + 1);
  bytes = 5;
  return registers.write(word(request, 1), value);
}

ModbusException write_and_read(Request request, ModbusRegisters& registers, Reply reply,
                               std::size_t& bytes) {
  if (request.size() < 10) return ModbusException::illegal_value;
  const std::size_t read_count = word(request, 3);
  if (read_count < 1 || read_count > kMostRead) return ModbusException::illegal_value;
  const ModbusException refused =
      write_from(registers, word(request, 5), word(request, 7), kMostWrittenAndRead, request, 10);
  if (refused != ModbusException::none) return refused;
  return read_into(registers, word(request, 1), read_count, reply, bytes);
}

ModbusException answer(Request request, ModbusRegisters& registers, Reply reply,
                       std::size_t& bytes) {
  switch (request[0]) {
    case kReadHolding:
    case kReadInput:
      if (request.size() != 5) return ModbusException::illegal_value;
      return read_into(registers, word(request, 1), word(request, 3), reply, bytes);
    case kWriteOne:
      return write_one(request, registers, reply, bytes);
    case kWriteMany:
      return write_many(request, registers, reply, bytes);
    case kWriteAndRead:
      return write_and_read(request, registers, reply, bytes);
    default:
      return ModbusException::illegal_function;
  }
}

}  // namespace

std::size_t answer_request(Request request, ModbusConnection from, ModbusRegisters& registers,
                           Reply reply) {
  if (request.empty()) return 0;
  registers.begin_request(from);
  reply[0] = request[0];
  std::size_t bytes = 0;
  const ModbusException refused = answer(request, registers, reply, bytes);
  if (refused != ModbusException::none) return exception_reply(request[0], refused, reply);
  return bytes;
}

std::size_t exception_reply(std::uint8_t function, ModbusException code, Reply reply) noexcept {
  reply[0] = static_cast<std::uint8_t>(function | 0x80U);
  reply[1] = static_cast<std::uint8_t>(code);
  return 2;
}

}  // namespace stageid
