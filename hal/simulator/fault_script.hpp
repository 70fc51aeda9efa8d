#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hal/simulator/simulated_stage.hpp"

namespace stageid {

/// Plays the faults of a WaferStageSpec. Cycles count exchanges of a run: in cycle n the command
/// u[n] is taken and the measurement y[n+1] given.
///
///   stuck_actuator  keeps the force of its last good cycle, silently
///   missed_cycle    the command does not arrive, the last one stays; nothing new is measured: stale
///   dead_sensor     does not answer: its valid bit is cleared, its value held: incomplete
///   stuck_sensor    shows its last value for ever and calls it valid
///   nan_sensor      measures NaN and calls it valid: only a check of the value can tell
///   sensor_offset   shows `value` metres too much from one sample to the next
///   sensor_drift    shows more by `value` metres every second
///   actuator_gain   gives `value` times its force: -1 reversed, 0 dead
///   extra_delay     all forces come `value` samples later
///   interlock       the amplifiers go off: forces zero, measurements go on: fault
///
/// All of them last until the end of the run but missed_cycle, which lasts `cycles`. The last four may
/// have channel -1: all channels.
class FaultScript {
 public:
  /// @throws std::invalid_argument if a channel does not exist, a missed_cycle lasts no cycle, or a
  /// value makes no sense.
  FaultScript(std::vector<WaferStageSpec::Fault> faults, const StageInfo& info);

  void start_run(int run) noexcept;
  bool missed(std::uint64_t cycle) const noexcept;
  bool interlock(std::uint64_t cycle) const noexcept;
  /// Replaces the forces of actuators that do not give what they should. `applied`: what they gave
  /// in the last cycle.
  void drive(std::uint64_t cycle, std::span<const double> applied, std::span<double> u) noexcept;
  /// Spoils a fresh measurement; `y` still holds the last one where `fresh` is not copied.
  /// @return the valid bits to clear.
  std::uint64_t spoil(std::uint64_t cycle, std::span<double> fresh,
                      std::span<const double> last) const noexcept;
  bool empty() const noexcept { return faults_.empty(); }

 private:
  using Fault = WaferStageSpec::Fault;
  bool active(const Fault& fault, std::uint64_t cycle) const noexcept;
  bool any(Fault::Kind kind, std::uint64_t cycle) const noexcept;

  std::vector<Fault> faults_;
  void delay(std::uint64_t cycle, std::span<double> u) noexcept;

  double period_s_ = 0.0;
  std::size_t history_cycles_ = 0;
  std::vector<double> history_;  // of forces, a ring; empty if no delay grows
  int run_ = -1;
};

}  // namespace stageid
