#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hal/simulated_stage.hpp"

namespace stageid {

/// Plays the faults of a WaferStageSpec. Cycles count exchanges of a run: in cycle n the command
/// u[n] is taken and the measurement y[n+1] given.
///
///   stuck_actuator  keeps the force of its last good cycle, silently
///   missed_cycle    the command does not arrive, the last one stays; nothing new is measured: stale
///   dead_sensor     does not answer: its valid bit is cleared, its value held: incomplete
///   stuck_sensor    shows its last value for ever and calls it valid
///   nan_sensor      measures NaN and calls it valid: only a check of the value can tell
///   interlock       the amplifiers go off: forces zero, measurements go on: fault
///
/// All of them last until the end of the run but missed_cycle, which lasts `cycles`.
class FaultScript {
 public:
  /// @throws std::invalid_argument if a channel does not exist or a missed_cycle lasts no cycle.
  FaultScript(std::vector<WaferStageSpec::Fault> faults, std::size_t actuators,
              std::size_t sensors);

  void start_run(int run) noexcept;
  bool missed(std::uint64_t cycle) const noexcept;
  bool interlock(std::uint64_t cycle) const noexcept;
  /// Replaces the commands of stuck actuators by what was applied in the last cycle.
  void stick(std::uint64_t cycle, std::span<const double> applied,
             std::span<double> u) const noexcept;
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
  int run_ = -1;
};

}  // namespace stageid
