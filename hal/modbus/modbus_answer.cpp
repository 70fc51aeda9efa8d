#include "hal/modbus/modbus_answer.hpp"

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

/// A request and the reply to it.
struct Transaction {
  Request request;
  ModbusRegisters& registers;
  Reply reply;
  std::size_t bytes = 0;  // of the reply

  std::uint16_t word(std::size_t at) const {
    return static_cast<std::uint16_t>((request[at] << 8) | request[at + 1]);
  }

  /// Reads `count` registers into a reply that starts with function and byte count.
  ModbusException read(int first, std::size_t count) {
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
  ModbusException write(int first, std::size_t count, std::size_t most, std::size_t at) {
    if (count < 1 || count > most || request[at - 1] != 2 * count ||
        request.size() != at + 2 * count)
      return ModbusException::illegal_value;
    std::array<std::uint16_t, kMostWritten> values{};
    for (std::size_t i = 0; i < count; ++i) values[i] = word(at + 2 * i);
    return registers.write(first, std::span(values).first(count));
  }

  /// The reply to a write repeats the address and the value or count.
  void repeat() {
    std::copy_n(request.begin() + 1, 4, reply.begin() + 1);
    bytes = 5;
  }

  ModbusException answer() {
    switch (request[0]) {
      case kReadHolding:
      case kReadInput:
        if (request.size() != 5) return ModbusException::illegal_value;
        return read(word(1), word(3));
      case kWriteOne:
        if (request.size() != 5) return ModbusException::illegal_value;
        repeat();
        return registers.write(word(1), std::array{word(3)});
      case kWriteMany:
        if (request.size() < 6) return ModbusException::illegal_value;
        repeat();
        return write(word(1), word(3), kMostWritten, 6);
      case kWriteAndRead: {
        if (request.size() < 10 || word(3) < 1 || word(3) > kMostRead)
          return ModbusException::illegal_value;
        const ModbusException refused = write(word(5), word(7), kMostWrittenAndRead, 10);
        return refused == ModbusException::none ? read(word(1), word(3)) : refused;
      }
      default:
        return ModbusException::illegal_function;
    }
  }
};

}  // namespace

std::size_t answer_request(Request request, ModbusConnection from, ModbusRegisters& registers,
                           Reply reply) {
  if (request.empty()) return 0;
  registers.begin_request(from);
  reply[0] = request[0];
  Transaction transaction{request, registers, reply};
  const ModbusException refused = transaction.answer();
  if (refused != ModbusException::none) return exception_reply(request[0], refused, reply);
  return transaction.bytes;
}

std::size_t exception_reply(std::uint8_t function, ModbusException code, Reply reply) noexcept {
  reply[0] = static_cast<std::uint8_t>(function | 0x80U);
  reply[1] = static_cast<std::uint8_t>(code);
  return 2;
}

}  // namespace stageid
