#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/stage.hpp"

namespace stageid {

/// What stands around the stage: enable chain, gravity compensators, temperatures, interlocks.
struct PlantSnapshot {
  std::int64_t t_ns = 0;  ///< when it was read; older than three poll periods is stale
  std::uint32_t heartbeat = 0;
  bool interlock_closed = false;
  bool enabled = false;
  NodeState state = NodeState::not_ready;
  std::vector<double> gravity_compensator_n;
  std::vector<double> temperature_k;
};

enum class SupervisorCommand : std::uint8_t { enable, disable, quick_stop, reset_fault };

struct SupervisorReply {
  bool accepted = false;
  std::string message;
};

/// The slow door beside the cyclic one, typically a PLC behind Modbus.
class Supervisor {
 public:
  virtual ~Supervisor() = default;
  virtual PlantSnapshot snapshot() const = 0;
  virtual SupervisorReply request(SupervisorCommand command) = 0;
};

}  // namespace stageid
