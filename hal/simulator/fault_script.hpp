#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hal/simulator/modal_plant.hpp"
#include "hal/simulator/simulated_stage.hpp"

namespace stageid {

enum class FaultTarget : std::uint8_t { stage, sensor, actuator, mode };

struct FaultTraits {
  FaultTarget target;
  bool may_be_all;  ///< accepts channel -1
  bool may_ramp;
};
FaultTraits fault_traits(SimulationSpec::Fault::Kind kind) noexcept;

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
///   sensor_gain     multiplies the measured value, with its noise, by `value`
///   sensor_noise    multiplies the noise by `value`
///   actuator_gain   multiplies the force by `value`: -1 reversed, 0 dead
///   extra_delay     delays all forces by `value` samples
///   mode_frequency  multiplies the natural frequency by 1 + `value`; the motion has no step
///   mode_damping    multiplies the damping ratio by 1 + `value`
///   added_mass      `value` kg (kg m^2 at a torque) that moves with an actuator along its direction: loaded_modes()
///   interlock       switches the amplifiers off: forces zero, measurements continue: fault
///
/// All last until the end of the run, except missed_cycle, which lasts `cycles`. Those with a `value` may have
/// channel -1: all channels, or all flexible modes. With `ramp_s` the change grows linearly from zero at t_(from_cycle);
/// not for sensor_drift. Forces and modes have the value at the middle of a cycle, sensors that at the sample, and
/// extra_delay whole samples. A mass grows in kMassSteps equal steps.
class FaultScript {
 public:
  static constexpr int kMassSteps = 100;
  /// @throws std::invalid_argument if a channel or mode does not exist, a missed_cycle has no cycles, or a value or a
  /// ramp is invalid.
  FaultScript(std::vector<SimulationSpec::Fault> faults, const StageInfo& info,
              const std::vector<PlantMode>& modes);

  void start_run(int run) noexcept;
  /// Whether a fault of this kind acts.
  bool any(SimulationSpec::Fault::Kind kind, std::uint64_t cycle) const noexcept;
  /// Replaces the forces of faulty actuators. `applied`: forces of the last cycle.
  void drive(std::uint64_t cycle, std::span<const double> applied, std::span<double> u) noexcept;
  /// Sets the modes of the plant for this cycle.
  void retune(std::uint64_t cycle, ModalPlant& plant) noexcept;
  /// Scales the noise of the measurement.
  void amplify(std::uint64_t cycle, std::span<double> noise) const noexcept;
  /// Corrupts a fresh measurement; `last` is the previous one.
  /// @return the valid bits to clear.
  std::uint64_t spoil(std::uint64_t cycle, std::span<double> fresh,
                      std::span<const double> last) const noexcept;
  bool empty() const noexcept { return faults_.empty(); }

 private:
  using Fault = SimulationSpec::Fault;
  bool active(const Fault& fault, std::uint64_t cycle) const noexcept;
  void load(const Fault& fault, const StageInfo& info, const std::vector<PlantMode>& modes);
  void carry(std::uint64_t cycle, ModalPlant& plant) noexcept;
  double growth(const Fault& fault, std::uint64_t cycle) const noexcept;
  double factor(const Fault& fault, std::uint64_t cycle) const noexcept;
  void delay(std::uint64_t cycle, std::span<double> u) noexcept;

  struct Mode {
    double natural_frequency_hz = 0.0;
    double damping_ratio = 0.0;
    bool operator==(const Mode&) const = default;
  };

  std::vector<Fault> faults_;
  double period_s_ = 0.0;
  std::size_t history_cycles_ = 0;
  std::vector<double> history_;  // ring of past forces; empty if no fault adds a delay
  std::vector<Mode> modes_;      // without faults; empty if no fault changes a mode
  std::vector<Mode> tuned_;      // in this cycle
  // With the share i / (size - 1) of the added mass; empty without. The index of this cycle.
  std::vector<LoadedModes> loaded_;
  std::size_t load_ = 0;
  int run_ = -1;
};

}  // namespace stageid
