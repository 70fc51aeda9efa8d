#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/stage/stage.hpp"

namespace stageid {

/// Why a node went to fault. The values travel in frames and registers: append only.
enum class FaultCause : std::uint8_t {
  none,
  watchdog,       ///< the host fell silent while it measured
  limit,          ///< a limit was hit
  not_finite,     ///< a command or a measurement was no number
  interlock,      ///< the interlock chain opened
  amplifier,      ///< the stage itself reported a fault
  gravity,        ///< a gravity compensator is out of range
  temperature,    ///< a temperature is out of range
  bus_off,        ///< the node's bus left
  host_heartbeat  ///< the supervisor's heartbeat stood still
};
const char* to_string(FaultCause cause) noexcept;

/// What stands around the stage: enable chain, gravity compensators, temperatures, interlocks.
struct PlantSnapshot {
  std::int64_t t_ns = 0;  ///< when it was read; older than three poll periods is stale
  std::uint32_t heartbeat = 0;
  bool interlock_closed = false;
  bool enabled = false;
  NodeState state = NodeState::not_ready;
  FaultCause cause = FaultCause::none;
  std::vector<double> gravity_compensator_n;
  std::vector<double> temperature_k;
};

enum class SupervisorCommand : std::uint8_t { enable, disable, quick_stop, reset_fault };

struct SupervisorReply {
  bool accepted = false;
  std::string message;
};

/// The slow door beside the cyclic one, typically a PLC behind Modbus. Any thread may call it.
class Supervisor {
 public:
  virtual ~Supervisor() = default;
  /// The last one that was read and passed its checks.
  virtual PlantSnapshot snapshot() const = 0;
  /// Waits for the answer; without one the command counts as refused.
  virtual SupervisorReply request(SupervisorCommand command) = 0;
  /// One line: why there is no fresh snapshot; empty if there is one.
  virtual std::string trouble() const = 0;
};

}  // namespace stageid
