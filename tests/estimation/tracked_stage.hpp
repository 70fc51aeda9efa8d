#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>

#include "estimation/tracking/model_tracker.hpp"
#include "tests/support/models/model_reference.hpp"
#include "tests/support/process/random_numbers.hpp"

// A stage with two sensors and three actuators that is tracked: its properties, model and spectra.
namespace stageid::test {

inline constexpr double kTrackedRateHz = 2000.0;

/// Properties of the stage, as a mechanical engineer would state them.
struct StageProperties {
  std::array<double, 4> frequency_hz = {71.0, 122.0, 188.0, 253.0};
  std::array<double, 4> damping_ratio = {0.012, 0.01, 0.015, 0.02};
  Eigen::VectorXd sensor_gain = Eigen::VectorXd::Ones(2);
  Eigen::VectorXd actuator_gain = Eigen::VectorXd::Ones(3);
  double delay_s = 3.1e-4;
};

/// The mass-normalized numerator of mode i: N_0, and N_1 of a mode with general viscous damping.
std::array<Eigen::MatrixXd, 2> mode_numerator(std::size_t i);

/// The model of a stage: rigid body, four modes and a direct term.
AdditiveModel model_of(const StageProperties& stage);

inline Eigen::VectorXd tracked_lines_hz() { return Eigen::VectorXd::LinSpaced(60, 20.0, 315.0); }

/// The stage in closed loop, period after period: Y = P U + v, U = U0 - K v.
class LoopSpectra {
 public:
  explicit LoopSpectra(std::uint64_t seed) : random_(seed) {
    excite();
    become({});
  }
  /// Another excitation.
  void excite() { U0_ = circular_matrix(random_, 3, tracked_lines_hz().size()); }
  /// Another excitation, which does not move a mode.
  void excite_all_but(std::size_t mode);
  void become(const StageProperties& stage);
  /// From now on, every period begins in another state of two modes: of the rms of the noise, times this.
  void move(double motion) { motion_ = motion; }
  void multiply_noise(Eigen::Index sensor, double factor) { noise_[sensor] *= factor; }

  /// @param disturbance rms of a force on the stage in this period, relative to the noise
  PeriodSpectra next(double disturbance = 0.0);

  /// Spectra, n_y x N, of one period of y(t) = phi e^(-zeta omega t) (a cos + b sin)(omega_d t), sample by sample.
  static Eigen::MatrixXcd free_response(std::size_t mode, double a, double b);

 private:
  /// The noise in U is a tenth of the excitation.
  static Eigen::MatrixXcd controller() {
    const std::complex<double> j(0.0, 1.0);
    return Eigen::MatrixXcd{{3e5 + 2e5 * j, -1e5}, {1e5 * j, 4e5}, {-2e5, 2e5 + 3e5 * j}};
  }

  RandomNumbers random_;
  double motion_ = 0.0;
  Eigen::VectorXd noise_ = Eigen::Vector2d(8e-7, 16e-7);
  Eigen::MatrixXcd U0_;
  Eigen::MatrixXcd P_;
};

}  // namespace stageid::test
