#pragma once

#include <Eigen/Core>
#include <vector>

#include "hal/simulator/added_mass.hpp"
#include "hal/simulator/plant_spec.hpp"

namespace stageid {

/// Linear plant in modal coordinates, discretized exactly for zero-order-held inputs with a delay of delay_s:
/// u[n] acts from t_n + delay_s to t_(n+1) + delay_s. With delay_s fs = d + e, 0 <= e < 1, two commands act
/// within one sample interval,
///   x[n+1] = E(T) x[n] + E((1-e) T) F(e T) u[n-d-1] + F((1-e) T) u[n-d].
///
/// Modes are stored in lanes of fixed width, so that every inner loop is one or two vector instructions.
/// reset(), step() and output() do not allocate.
class ModalPlant {
 public:
  /// @throws std::invalid_argument if there is no mode, shapes differ in size, a damping ratio is
  ///         outside [0, 1), a frequency or the delay is negative, or the rate is not positive.
  ModalPlant(const std::vector<PlantMode>& modes, double delay_s, double sample_rate_hz);

  Eigen::Index actuators() const noexcept { return actuators_; }
  Eigen::Index sensors() const noexcept { return sensors_; }

  /// Standstill: all coordinates, velocities and held forces zero.
  void reset() noexcept;
  /// Advances by one sample interval with command u[n] (size actuators).
  void step(const double* u) noexcept;
  /// Writes y at the current instant (size sensors).
  void output(double* y) const noexcept;

  /// Modal coordinate, mass-normalized: kg^(1/2) m.
  double coordinate(Eigen::Index mode) const noexcept { return q_[mode]; }
  /// Changes frequency and damping ratio of a mode from this instant on, without a step in its motion. Does not
  /// allocate.
  void retune(Eigen::Index mode, double natural_frequency_hz, double damping_ratio) noexcept;
  /// Changes all modes from this instant on, without a step in motion or forces. Does not allocate.
  /// @param from the present modes   @param to as many modes, of the same plant with another mass
  void reload(const LoadedModes& from, const LoadedModes& to) noexcept;
  /// Adds a modal force that is undelayed and constant during the next step().
  void add_modal_force(Eigen::Index mode, double force) noexcept {
    extra_mode_ = mode;
    extra_force_ = force;
  }

 private:
  void add_accelerations(double* y) const noexcept;
  void take(Eigen::Index i, const PlantMode& mode) noexcept;
  void modal_force(const double* u, double* force) const noexcept;

  double period_s_ = 0.0;
  double fraction_ = 0.0;  // of the delay, in samples
  Eigen::Index actuators_ = 0;
  Eigen::Index sensors_ = 0;
  Eigen::Index modes_ = 0;              // padded to a multiple of the lane width
  Eigen::ArrayXXd actuator_shape_;      // modes x actuators
  Eigen::ArrayXXd sensor_shape_;        // padded sensors x modes
  Eigen::MatrixXd acceleration_shape_;  // sensors x modes; empty without sensors of acceleration
  Eigen::ArrayXXd resistance_;          // modes x 2: omega^2, 2 zeta omega
  Eigen::ArrayXXd step_;       // modes x 8: E(T) by rows, input of the old and of the new command
  Eigen::ArrayXXd undelayed_;  // modes x 2: F(T), for add_modal_force
  Eigen::ArrayXXd held_;       // modes x (d + 2), ring of modal forces
  Eigen::Index newest_ = 0;
  Eigen::ArrayXd q_;
  Eigen::ArrayXd v_;
  Eigen::VectorXd unloaded_;  // scratch of reload()
  Eigen::Index extra_mode_ = -1;
  double extra_force_ = 0.0;
  Eigen::Index last_extra_mode_ = -1;  // of the last step
};

}  // namespace stageid
