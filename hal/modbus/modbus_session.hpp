#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/modbus/modbus_client.hpp"
#include "hal/modbus/modbus_encoding.hpp"
#include "hal/stage/stage.hpp"
#include "hal/stage/supervisor.hpp"

namespace stageid {

// Exchanges between host and node before and after a run, without timing requirements. Each is tried twice,
// with a drain in between.

/// Reads `count` registers starting at `first`, in as many transactions as needed.
/// @throws StageError, with the link closed.
std::vector<std::uint16_t> read_registers(ModbusClient& link, int first, std::size_t count);

inline constexpr const char* kForeignReplies =
    "replies do not match the requests; check that only one program uses the link, and check the "
    "unit";

/// Describes a mismatch of the register map in the status registers; empty: none.
std::string map_trouble(RegisterBlock<const std::uint16_t> status);

struct ModbusDescription {
  std::uint32_t boot_id = 0;
  std::vector<double> actuator_scale;  ///< SI per count
  std::vector<double> sensor_scale;
};

/// Reads the node's description and compares it with the expected one.
/// @throws StageError if it is not a stage, or has another map, other channels or another rate.
ModbusDescription read_description(ModbusClient& link, const StageInfo& expected);

struct ModbusState {
  NodeState state = NodeState::not_ready;
  FaultCause cause = FaultCause::none;
  bool interlock_closed = false;
  bool enabled = false;  ///< operation_enabled or measuring
};
/// @throws StageError
ModbusState read_state(ModbusClient& link);

/// @throws StageError if it is refused; the message names state and cause.
void give_supervisor_command(ModbusClient& link, SupervisorCommand command);

/// Begins a run; `reply` receives the measurement block with y[0]. @return the key of the run.
/// @throws StageError if it is refused or not answered.
std::uint32_t begin_run(ModbusClient& link, std::uint64_t run_seed,
                        std::vector<std::uint16_t>& reply);
/// Ends the run of this key. @throws StageError as begin_run().
void end_run(ModbusClient& link, std::uint32_t session, std::vector<std::uint16_t>& reply);

}  // namespace stageid
