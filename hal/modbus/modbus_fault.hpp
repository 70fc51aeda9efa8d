#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace stageid {

/// What a simulated Modbus server can do wrong on request.
struct ModbusFault {
  enum class Kind : std::uint8_t {
    late_reply,   ///< the reply comes `value` seconds late
    half_frame,   ///< the second half of the reply is missing
    wrong_unit,   ///< another unit answers, with nothing but zeros
    exception,    ///< exception code `value` instead of a reply
    dead_server,  ///< the server hangs up and never answers again
    heartbeat,    ///< the heartbeat is no longer echoed
    interlock,    ///< the interlock is open
    temperature,  ///< the first temperature is `value` kelvin
    gravity       ///< the first gravity compensator carries `value` newton
  };
  Kind kind = Kind::late_reply;
  std::uint64_t from = 1;   ///< the first request it concerns, 1-based
  std::uint64_t count = 1;  ///< how many requests; 0: all that follow
  double value = 0.0;
};

/// Reads `KIND[@REQUEST][xCOUNT][:VALUE]`: "late_reply@200:0.4", "exception@50x3:4", "interlock@100".
/// COUNT is 1 for faults of one reply, otherwise all that follow.
/// @throws std::invalid_argument that says what is wrong and what would be right.
ModbusFault parse_modbus_fault(std::string_view text);

/// Says which faults are on, request by request.
class ModbusFaultScript {
 public:
  explicit ModbusFaultScript(std::vector<ModbusFault> faults = {});
  void next_request() noexcept { ++request_; }
  /// The fault of that kind that is on now, or null.
  const ModbusFault* active(ModbusFault::Kind kind) const noexcept;
  /// Whether a fault of that kind will ever be on.
  bool mentions(ModbusFault::Kind kind) const noexcept;

 private:
  std::vector<ModbusFault> faults_;
  std::uint64_t request_ = 0;
};

}  // namespace stageid
