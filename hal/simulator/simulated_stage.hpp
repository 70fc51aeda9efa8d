#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "excitation/words/words.hpp"
#include "hal/stage/limits.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// One mode of a simulated plant:
///   (sensor_shape + s^2 acceleration_shape) actuator_shape^T / (s^2 + 2 zeta omega s + omega^2),
/// mass-normalized, in the units of the channels.
struct PlantMode {
  double natural_frequency_hz = 0.0;
  double damping_ratio = 0.0;
  Eigen::VectorXd actuator_shape;           ///< size actuators
  Eigen::VectorXd sensor_shape;             ///< size sensors
  Eigen::VectorXd acceleration_shape = {};  ///< of sensors of acceleration; empty: none
};

/// A wafer stage: free rectangular plate on weak springs with actuators and sensors at positions.
struct WaferStageSpec {
  StageInfo info;
  StageLimits limits;
  MotionControllerSpec controller;

  // Rigid body
  double mass_kg = 0.0;
  double inertia_kg_m2[3] = {0., 0., 0.};              ///< about x, y, z
  double suspension_hz[6] = {0., 0., 0., 0., 0., 0.};  ///< gravity compensators: x y z Rx Ry Rz
  double suspension_damping = 0.0;

  // Free plate (Rayleigh-Ritz with Legendre polynomials): out-of-plane flexible modes
  double length_x_m = 0.0;
  double length_y_m = 0.0;
  double first_mode_hz = 0.0;  ///< scales the plate's stiffness
  double poisson_ratio = 0.3;
  int flexible_modes = 0;  ///< number of modes, including those above the band of interest
  std::vector<double> flexible_damping;  ///< one per mode, the last repeats
  std::vector<PlantMode> in_plane_modes;

  double sensor_noise_m = 0.0;           ///< rms of the white part
  double sensor_noise_coloured_m = 0.0;  ///< rms of the coloured floor (first-order low pass)
  double sensor_noise_corner_hz = 1.0;
  double force_noise_n = 0.0;     ///< rms of white force disturbance at every actuator
  double sensor_quantum_m = 0.0;  ///< 0: off
  double actuator_quantum_n = 0.0;
  double cubic_stiffness_n_m3 = 0.0;   ///< on the rigid z motion; 0: off (linear)
  double actuator_saturation_n = 0.0;  ///< 0: off

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
      extra_delay
    };
    Kind kind = Kind::none;
    int channel = 0;  ///< -1: all, where FaultScript allows it
    std::uint64_t from_cycle = 0;
    std::uint64_t cycles = 1;  ///< missed_cycle: number of cycles
    int run = -1;              ///< affected start() of the process, 0-based; -1: all
    double value = 0.0;        ///< m, m/s, factor or samples: see FaultScript
  };
  std::vector<Fault> faults;
  std::uint64_t seed = 0;
  double pace = 0.0;  ///< 0: virtual time; 1: wall clock

  /// Whether the plant is described. Only then can the stage be simulated and its signals predicted.
  bool has_plant() const noexcept { return mass_kg > 0.0; }
};
template <>
inline constexpr std::array kWords<WaferStageSpec::Fault::Kind> = {
    "none",         "dead_sensor",    "nan_sensor",   "missed_cycle",
    "interlock",    "stuck_actuator", "stuck_sensor", "sensor_offset",
    "sensor_drift", "actuator_gain",  "extra_delay"};

/// All modes of the stage: rigid-body ones on their suspension first, then flexible out of plane by
/// frequency, then in plane.
/// @throws std::invalid_argument naming the field, its value, and the permitted values.
std::vector<PlantMode> wafer_stage_modes(const WaferStageSpec& spec);

/// The exact frequency response of the plant without controller, sensors x actuators, through zero-order hold, delay
/// and sampler: G_d(e^{j omega T}).
Eigen::MatrixXcd sampled_response(const std::vector<PlantMode>& modes, double delay_s,
                                  double sample_rate_hz, double frequency_hz);

/// The simulated stage in modal coordinates, discretized exactly (zero-order hold, non-integer delay).
///
/// @throws std::invalid_argument from the constructor, naming the field.
class SimulatedStage final : public CyclicStage {
 public:
  explicit SimulatedStage(const WaferStageSpec& spec);
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
