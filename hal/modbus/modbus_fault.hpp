#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "excitation/words/words.hpp"

namespace stageid {

/// A simulated fault of a Modbus server.
struct ModbusFault {
  /// Those from dead_server on last until the end unless a count is given.
  enum class Kind : std::uint8_t {
    late_reply,   ///< the reply is `value` seconds late
    half_frame,   ///< the second half of the reply is missing
    wrong_unit,   ///< the reply has another unit and zeros as data
    exception,    ///< exception code `value` instead of a reply
    dead_server,  ///< the server closes all connections and never answers again
    heartbeat,    ///< the heartbeat is no longer echoed
    interlock,    ///< the interlock is open
    temperature,  ///< the first temperature is `value` kelvin
    gravity       ///< the force of the first gravity compensator is `value` newton
  };
  Kind kind = Kind::late_reply;
  std::uint64_t from = 1;   ///< first affected request, 1-based
  std::uint64_t count = 1;  ///< number of affected requests; 0: all that follow
  double value = 0.0;
};
template <>
inline constexpr std::array kWords<ModbusFault::Kind> = {"late_reply", "half_frame",  "wrong_unit",
                                                         "exception",  "dead_server", "heartbeat",
                                                         "interlock",  "temperature", "gravity"};

/// Reads `KIND[@REQUEST][xCOUNT][:VALUE]`: "late_reply@200:0.4", "exception@50x3:4", "interlock@100".
/// The default COUNT is 1 for faults of one reply, otherwise unlimited.
/// @throws std::invalid_argument naming the problem and the correct form.
ModbusFault parse_modbus_fault(std::string_view text);

/// Determines the active faults, request by request.
class ModbusFaultScript {
 public:
  explicit ModbusFaultScript(std::vector<ModbusFault> faults = {});
  void next_request() noexcept { ++request_; }
  /// The active fault of that kind, or null.
  const ModbusFault* active(ModbusFault::Kind kind) const noexcept;
  /// Whether the script contains a fault of that kind.
  bool mentions(ModbusFault::Kind kind) const noexcept;

 private:
  std::vector<ModbusFault> faults_;
  std::uint64_t request_ = 0;
};

}  // namespace stageid
