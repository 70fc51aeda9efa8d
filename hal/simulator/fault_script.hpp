#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hal/simulator/simulated_stage.hpp"

namespace stageid {

/// Applies the faults of a SimulationSpec. Cycles count the exchanges of a run: cycle n takes the command
/// u[n] and returns the measurement y[n+1].
///
///   stuck_actuator  silently keeps the force of its last good cycle
///   missed_cycle    the command is lost and the last one remains; no new measurement: stale
///   dead_sensor     no answer: its valid bit is cleared, its value held: incomplete
///   stuck_sensor    repeats its last value forever, marked valid
///   nan_sensor      measures NaN, marked valid: only a check of the value detects it
///   sensor_offset   adds `value` metres from one sample to the next
///   sensor_drift    adds `value` metres per second
///   actuator_gain   multiplies the force by `value`: -1 reversed, 0 dead
///   extra_delay     delays all forces by `value` samples
///   interlock       switches the amplifiers off: forces zero, measurements continue: fault
///
/// All last until the end of the run, except missed_cycle, which lasts `cycles`. sensor_offset, sensor_drift and
/// actuator_gain may have channel -1: all channels.
class FaultScript {
 public:
  /// @throws std::invalid_argument if a channel does not exist, a missed_cycle has no cycles, or a value is
  /// invalid.
  FaultScript(std::vector<SimulationSpec::Fault> faults, const StageInfo& info);

  void start_run(int run) noexcept;
  /// Whether a fault of this kind acts.
  bool any(SimulationSpec::Fault::Kind kind, std::uint64_t cycle) const noexcept;
  /// Replaces the forces of faulty actuators. `applied`: forces of the last cycle.
  void drive(std::uint64_t cycle, std::span<const double> applied, std::span<double> u) noexcept;
  /// Corrupts a fresh measurement; `last` is the previous one.
  /// @return the valid bits to clear.
  std::uint64_t spoil(std::uint64_t cycle, std::span<double> fresh,
                      std::span<const double> last) const noexcept;
  bool empty() const noexcept { return faults_.empty(); }

 private:
  using Fault = SimulationSpec::Fault;
  bool active(const Fault& fault, std::uint64_t cycle) const noexcept;
  void delay(std::uint64_t cycle, std::span<double> u) noexcept;

  std::vector<Fault> faults_;
  double period_s_ = 0.0;
  std::size_t history_cycles_ = 0;
  std::vector<double> history_;  // ring of past forces; empty if no fault adds a delay
  int run_ = -1;
};

}  // namespace stageid
