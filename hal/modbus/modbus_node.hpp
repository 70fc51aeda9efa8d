#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "hal/modbus/modbus_answer.hpp"
#include "hal/modbus/modbus_encoding.hpp"
#include "hal/modbus/modbus_fault.hpp"
#include "hal/modbus/modbus_map.hpp"
#include "hal/node/stage_node.hpp"

namespace stageid {

/// Maps a StageNode to the registers of modbus_map, for one server.
///
/// A setpoint with a newer sequence number advances the stage by one sample. The measurement read in the
/// same request belongs to it. A duplicate number does not advance the stage. Skipped numbers are counted as
/// missed and are not made up for.
///
/// A run is controlled by the connection that began it, with the key that the node drew for it. Requests of
/// other connections to begin, end or advance a run get exception 6 and change nothing.
///
/// Once a supervising host has incremented its heartbeat, it must continue while forces may act: a pause of
/// heartbeat_s causes a safe stop (FaultCause::host_heartbeat). Meanwhile no other connection may increment
/// it.
class ModbusNode final : public ModbusRegisters {
 public:
  /// `boot_id`: different at every start of the process, so that hosts detect a restart. `faults` may be null;
  /// it disturbs panel and heartbeat. All references are kept.
  /// @throws std::invalid_argument if the stage has more channels or panel values than the map, a channel has
  /// no range in `limits`, or a fault needs a missing panel value.
  ModbusNode(StageNode& node, const StageLimits& limits, std::uint32_t boot_id,
             ModbusFaultScript* faults, double heartbeat_s = 1.0);
  ModbusNode(ModbusNode&&) = delete;

  void begin_request(ModbusConnection from) override;
  void tick() override;
  [[nodiscard]] ModbusException write(int first, std::span<const std::uint16_t> values) override;
  [[nodiscard]] ModbusException read(int first, std::span<std::uint16_t> values) override;
  bool needs(ModbusConnection connection) const override;
  void hung_up(ModbusConnection connection) override;

 private:
  void describe_stage(const StageLimits& limits);
  void disturb_panel();
  void take_supervisor_command();
  ModbusException obey(int first, std::size_t count, RegisterBlock<const std::uint16_t> before);
  bool may_control_the_run(bool commands, bool moves) const;
  ModbusException take_run_command();
  ModbusException begin_run();
  void take_setpoint();
  void show_measurement(Outcome outcome, std::uint32_t sequence);
  void show_status();
  bool on(ModbusFault::Kind kind) const noexcept;

  StageNode& node_;
  ModbusFaultScript* faults_;
  std::array<std::uint16_t, modbus_map::kEnd> registers_{};
  RegisterBlock<std::uint16_t> map_{0, registers_};
  std::uint32_t boot_id_;
  ModbusConnection asking_ = 0;
  std::uint32_t session_ = 0;      // key of the last run begun by this front end; 0: none
  ModbusConnection owner_ = 0;     // connection that began the run
  ModbusConnection counting_ = 0;  // connection whose heartbeat is watched
  std::int64_t heartbeat_ns_;
  std::uint32_t last_heartbeat_ = 0;
  std::int64_t heartbeat_seen_ns_ = 0;  // 0: no heartbeat yet
  NodePanel undisturbed_;
  bool disturbed_ = false;
  std::vector<double> actuator_scale_;
  std::vector<double> sensor_scale_;
  std::vector<double> u_;
  std::vector<double> y_;
  Inputs inputs_;
  std::uint32_t missed_ = 0;  // skipped setpoints of this run
};

/// Range of every channel on the wire: twice its limit, so that limits are detected before the wire
/// saturates. @throws std::invalid_argument if there is no limit.
std::vector<float> modbus_scales(const Eigen::VectorXd& limits, std::size_t channels,
                                 const char* what);

}  // namespace stageid
