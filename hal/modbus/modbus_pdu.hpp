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
  gateway_target = 11  ///< the unit asked for is not here
};

/// One of a server's connections: never given twice.
using ModbusConnection = std::uint64_t;

/// What a server serves: holding registers.
class ModbusRegisters {
 public:
  virtual ~ModbusRegisters() = default;
  /// Called once for every request, before write() and read(): who asks.
  virtual void begin_request(ModbusConnection from) = 0;
  /// Called every few milliseconds, whether there are requests or not.
  virtual void tick() = 0;
  [[nodiscard]] virtual ModbusException write(int first, std::span<const std::uint16_t> values) = 0;
  [[nodiscard]] virtual ModbusException read(int first, std::span<std::uint16_t> values) = 0;
  /// Something depends on this connection: its place is not given to another one.
  virtual bool needs(ModbusConnection /*connection*/) const { return false; }
  /// It has ended.
  virtual void hung_up(ModbusConnection /*connection*/) {}
};

inline constexpr std::size_t kLargestPdu = 253;

/// Answers one request: functions 3 and 4 (read), 6 and 16 (write), 23 (write, then read). Others,
/// and requests whose lengths contradict each other, get an exception reply.
///
/// Our own, and not modbus_reply(): that reads beyond short requests (libmodbus #837), and can
/// neither run the stage between the write and the read of a function 23 nor spoil a reply on
/// request.
/// @return bytes of the reply; 0 for an empty request.
std::size_t answer_request(std::span<const std::uint8_t> request, ModbusConnection from,
                           ModbusRegisters& registers, std::span<std::uint8_t, kLargestPdu> reply);

/// The reply that refuses a request of this function. @return its bytes: 2.
std::size_t exception_reply(std::uint8_t function, ModbusException code,
                            std::span<std::uint8_t, kLargestPdu> reply) noexcept;

}  // namespace stageid
