#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// Cause of a node's fault. The values are transmitted: append only.
enum class FaultCause : std::uint8_t {
  none,
  watchdog,       ///< the host was silent while it measured
  limit,          ///< a limit was exceeded
  not_finite,     ///< a command or a measurement was not finite
  interlock,      ///< the interlock chain opened
  amplifier,      ///< the stage itself reported a fault
  gravity,        ///< a gravity compensator is out of range
  temperature,    ///< a temperature is out of range
  bus_off,        ///< the node's controller went off the bus
  host_heartbeat  ///< the supervisor's heartbeat stopped
};
template <>
inline constexpr std::array kWords<FaultCause> = {"none",
                                                  "the host stopped sending",
                                                  "a limit was exceeded",
                                                  "a value was not finite",
                                                  "the interlock opened",
                                                  "the stage reported a fault",
                                                  "a gravity compensator is out of range",
                                                  "a temperature is out of range",
                                                  "the bus is off",
                                                  "the supervisor's heartbeat stopped"};

/// Environment of the stage: enable chain, gravity compensators, temperatures, interlocks.
struct PlantSnapshot {
  std::int64_t t_ns = 0;  ///< time of reading; stale after three poll periods
  std::uint32_t heartbeat = 0;
  bool interlock_closed = false;
  bool enabled = false;
  NodeState state = NodeState::not_ready;
  FaultCause cause = FaultCause::none;
  std::vector<double> gravity_compensator_n;
  std::vector<double> temperature_k;
};

enum class SupervisorCommand : std::uint8_t { enable, disable, quick_stop, reset_fault };
template <>
inline constexpr std::array kWords<SupervisorCommand> = {"enable", "disable", "quick stop",
                                                         "reset"};

struct SupervisorReply {
  bool accepted = false;
  std::string message;
};

/// The slow interface beside the cyclic one, typically a PLC behind Modbus. Safe for concurrent use.
class Supervisor {
 public:
  virtual ~Supervisor() = default;
  /// The last valid snapshot.
  virtual PlantSnapshot snapshot() const = 0;
  /// Waits for the answer; no answer counts as a refusal.
  virtual SupervisorReply request(SupervisorCommand command) = 0;
  /// Reason for a missing fresh snapshot in one line; empty if there is one.
  virtual std::string trouble() const = 0;
};

}  // namespace stageid
