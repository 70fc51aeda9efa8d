#pragma once

#include <Eigen/Core>
#include <complex>
#include <numbers>

#include "estimation/loop/loop_transfer.hpp"
#include "tests/estimation/tracked_stage.hpp"

// Loops whose transfer can be written by hand, and the parameters of a model in the order of FitCovariance.
namespace stageid::test {

/// A free mass behind a hold and a PD controller with backward difference:
///   P(z) = T^2 / (2 m) (z + 1) / (z - 1)^2,   K(z) = kp + kd (z - 1) / (T z).
struct FreeMass {
  double mass_kg = 2.0;
  double period_s = 1e-3;
  double kp = 2e4;
  double kd = 300.0;

  AdditiveModel model() const;
  LoopController controller() const;
  std::complex<double> loop(std::complex<double> z) const {
    return period_s * period_s / (2.0 * mass_kg) * (z + 1.0) / ((z - 1.0) * (z - 1.0)) *
           (kp + kd * (z - 1.0) / (period_s * z));
  }
  std::complex<double> loop_at(double frequency_hz) const {
    return loop(std::polar(1.0, 2.0 * std::numbers::pi * frequency_hz * period_s));
  }
  /// The closed-loop poles: roots of z (z - 1)^2 + gain T^2 / (2 m) (z + 1) ((kp + kd / T) z - kd / T).
  Eigen::VectorXcd poles(double gain) const;
};

/// The stage of tracked_stage.hpp, decoupled by its rigid body: two loops with PD controllers.
LoopController tracked_controller();

/// Denominators, delays (0, 1: all outputs, or n_u + n_y - 1), numerators.
Eigen::VectorXd parameters_of(const AdditiveModel& model, Eigen::Index delays);

AdditiveModel with_parameters(AdditiveModel model, Eigen::Index delays, const Eigen::VectorXd& x);

}  // namespace stageid::test
