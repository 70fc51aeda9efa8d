#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "excitation/words/words.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// What a simulation adds to its plant: noise, the steps of converters, faults.
struct SimulationSpec {
  double sensor_noise_m = 0.0;           ///< rms of the white part
  double sensor_noise_coloured_m = 0.0;  ///< rms of the coloured floor (first-order low pass)
  double sensor_noise_corner_hz = 1.0;
  double force_noise_n = 0.0;     ///< rms of white force disturbance at every actuator
  double sensor_quantum_m = 0.0;  ///< 0: off
  double actuator_quantum_n = 0.0;

  /// Simulated faults, starting at a cycle of every run.
  struct Fault {
    enum class Kind : std::uint8_t {
      none,
      dead_sensor,
      nan_sensor,
      missed_cycle,
      interlock,
      stuck_actuator,
      stuck_sensor,
      sensor_offset,
      sensor_drift,
      actuator_gain,
      extra_delay,
      mode_frequency,
      mode_damping,
      sensor_gain,
      sensor_noise,
      added_mass
    };
    Kind kind = Kind::none;
    int channel = 0;  ///< or index into plant_modes(); -1: all, where FaultScript allows it
    std::uint64_t from_cycle = 0;
    std::uint64_t cycles = 1;  ///< missed_cycle: number of cycles
    int run = -1;              ///< affected start() of the process, 0-based; -1: all
    double value = 0.0;        ///< m, m/s, factor, relative change, samples, kg: see FaultScript
    double ramp_s = 0.0;       ///< the change grows linearly over this time; 0: a step
  };
  std::vector<Fault> faults;
  std::uint64_t seed = 0;
};
template <>
inline constexpr std::array kWords<SimulationSpec::Fault::Kind> = {
    "none",         "dead_sensor",    "nan_sensor",   "missed_cycle",
    "interlock",    "stuck_actuator", "stuck_sensor", "sensor_offset",
    "sensor_drift", "actuator_gain",  "extra_delay",  "mode_frequency",
    "mode_damping", "sensor_gain",    "sensor_noise", "added_mass"};

/// The simulated stage in modal coordinates, discretized exactly (zero-order hold, non-integer delay).
///
/// @throws std::invalid_argument from the constructor, naming the field.
class SimulatedStage final : public CyclicStage {
 public:
  /// @param pace 0: virtual time; otherwise stage seconds per second of wall clock
  SimulatedStage(const StageInfo& info, const PlantSpec& plant,
                 const SimulationSpec& simulation = {}, double pace = 0.0);
  ~SimulatedStage() override;

  const StageInfo& info() const noexcept override;
  void start(std::uint64_t run_seed, Inputs& first) override;
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override;
  void stop() noexcept override;

  /// True position of the stage at its sensors, without noise and faults (size sensors, m).
  void displacement(std::span<double> y_m) const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stageid
