#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace stageid {

/// Linear controller of one logical axis in continuous time: integrator + lead + low pass (+ notches). It is
/// discretized by Tustin's method with prewarping at the crossover (a notch at its own frequency). A frequency
/// of 0 disables its factor.
///   C(s) = gain_n_per_m (1 + w_i/s) (s/w_1 + 1)/(s/w_2 + 1) / (s^2/w_lp^2 + 2 d s/w_lp + 1) prod
///   notch
struct AxisController {
  double crossover_hz = 0.0;  ///< 0: the axis is open
  double gain = 0.0;          ///< N/m or Nm/rad; 0: motion_controller_spec() computes it
  double integrator_hz = 0.0;
  double lead_zero_hz = 0.0;
  double lead_pole_hz = 0.0;
  double lowpass_hz = 0.0;
  double lowpass_damping = 0.7;
  struct Notch {
    double frequency_hz = 0.0;
    double zero_damping = 0.0;
    double pole_damping = 0.0;
  };
  std::vector<Notch> notches;
  /// In an emergency, the axis is braked using its known motion; false: its forces are cut.
  bool brake = true;
};

struct MotionControllerSpec {
  double sample_rate_hz = 0.0;
  Eigen::MatrixXd sensor_decoupling;    ///< axes x sensors
  Eigen::MatrixXd actuator_decoupling;  ///< actuators x axes
  std::vector<AxisController> axes;
};

/// u = -T_u C(z) T_y y. Sizes fixed at construction; update() does not allocate.
class MotionController {
 public:
  /// @throws std::invalid_argument for invalid sizes or frequencies.
  explicit MotionController(const MotionControllerSpec& spec);

  void reset() noexcept;
  /// Writes (does not add) the control part of u (size actuators) computed from y (size sensors).
  void update(const double* y, double* u) noexcept;

  Eigen::Index sensors() const noexcept { return sensor_decoupling_.cols(); }
  Eigen::Index actuators() const noexcept { return actuator_decoupling_.rows(); }

  /// Frequency response -C(e^{j omega T}) from y to u, actuators x sensors.
  Eigen::MatrixXcd response(double frequency_hz) const;

 private:
  double sample_rate_hz_ = 0.0;
  Eigen::MatrixXd sensor_decoupling_;
  Eigen::MatrixXd actuator_decoupling_;
  // The axes are in parallel lanes of one vector register. All are padded to the same number of sections with
  // sections of gain 1.
  Eigen::Index sections_ = 0;
  Eigen::ArrayXXd sensor_columns_;    // padded axes x sensors
  Eigen::ArrayXXd coefficients_;      // padded axes x 5 per section: b0 b1 b2 a1 a2
  Eigen::ArrayXXd state_;             // padded axes x 2 per section
  Eigen::ArrayXXd actuator_columns_;  // padded actuators x axes
  Eigen::ArrayXd axis_;               // padded axes
};

}  // namespace stageid
