#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace stageid {

/// Exception codes of the Modbus application protocol V1.1b3, chapter 7.
enum class ModbusException : std::uint8_t {
  none = 0,
  illegal_function = 1,
  illegal_address = 2,
  illegal_value = 3,
  device_failure = 4,
  busy = 6,
  gateway_target = 11  ///< the requested unit does not exist here
};

/// Identifies one connection of a server; never reused.
using ModbusConnection = std::uint64_t;

/// The holding registers that a server provides.
class ModbusRegisters {
 public:
  virtual ~ModbusRegisters() = default;
  /// Called once per request, before write() and read(), with the sender.
  virtual void begin_request(ModbusConnection from) = 0;
  /// Called every few milliseconds, whether there are requests or not.
  virtual void tick() = 0;
  [[nodiscard]] virtual ModbusException write(int first, std::span<const std::uint16_t> values) = 0;
  [[nodiscard]] virtual ModbusException read(int first, std::span<std::uint16_t> values) = 0;
  /// Whether this connection must be kept when a new client needs its place.
  virtual bool needs(ModbusConnection /*connection*/) const { return false; }
  /// Called when the connection has ended.
  virtual void hung_up(ModbusConnection /*connection*/) {}
};

inline constexpr std::size_t kLargestPdu = 253;

/// Answers one request: functions 3 and 4 (read), 6 and 16 (write), 23 (write, then read). Other functions
/// and requests with inconsistent lengths get an exception reply.
///
/// modbus_reply() is not used: it reads beyond short requests (libmodbus #837). It can neither run the stage
/// between the write and the read of a function 23 nor corrupt a reply on request.
/// @return bytes of the reply; 0 for an empty request.
std::size_t answer_request(std::span<const std::uint8_t> request, ModbusConnection from,
                           ModbusRegisters& registers, std::span<std::uint8_t, kLargestPdu> reply);

/// The exception reply to a request of this function. @return its bytes: 2.
std::size_t exception_reply(std::uint8_t function, ModbusException code,
                            std::span<std::uint8_t, kLargestPdu> reply) noexcept;

}  // namespace stageid
