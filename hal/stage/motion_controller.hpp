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

/// A discrete controller in state space, at the sample rate of the stage:
///   x[n+1] = A x[n] + B y[n],   C(y)[n] = C x[n] + D y[n].
/// Without states, only D has entries.
struct ControllerStateSpace {
  Eigen::MatrixXd a;  ///< states x states
  Eigen::MatrixXd b;  ///< states x sensors
  Eigen::MatrixXd c;  ///< actuators x states
  Eigen::MatrixXd d;  ///< actuators x sensors

  bool empty() const noexcept { return c.size() == 0 && d.size() == 0; }
};

/// One entry of a transfer matrix: coefficients of falling powers of z.
struct ControllerTransfer {
  Eigen::Index actuator = 0;
  Eigen::Index sensor = 0;
  std::vector<double> numerator;
  std::vector<double> denominator;
};

/// The one description of a controller, u = f - C y + r. C is the sum of its parts; each may be empty:
///   C = T_u diag(C_axis) T_y + (transfer functions) + (state space).
struct MotionControllerSpec {
  double sample_rate_hz = 0.0;
  Eigen::MatrixXd sensor_decoupling;    ///< T_y, axes x sensors
  Eigen::MatrixXd actuator_decoupling;  ///< T_u, actuators x axes
  std::vector<AxisController> axes;
  std::vector<ControllerTransfer> transfer;
  ControllerStateSpace state_space;
  /// The stage closes its loop itself by a controller that is unknown here: nothing is computed, C = 0.
  bool by_peer = false;
  Eigen::VectorXd feed_forward_n;    ///< f of every actuator; empty: none
  double feed_forward_ramp_s = 0.1;  ///< f rises linearly from 0 in this time
};

/// u = f - C y. Sizes are fixed at construction; update() does not allocate.
class MotionController {
 public:
  /// @throws std::invalid_argument for invalid sizes, frequencies or coefficients.
  explicit MotionController(const MotionControllerSpec& spec);

  void reset() noexcept;
  /// Writes (does not add) f - C y to u (size actuators), from y (size sensors).
  void update(const double* y, double* u) noexcept;

  Eigen::Index sensors() const noexcept { return sensor_decoupling_.cols(); }
  Eigen::Index actuators() const noexcept { return actuator_decoupling_.rows(); }

  /// Samples after reset() until f has its final value; 0 without feed-forward.
  std::uint64_t feed_forward_samples() const noexcept { return ramp_samples_; }

  /// Whether C has any entry, i.e. a loop is closed.
  bool acts() const noexcept;

  /// Frequency response -C(e^{j omega T}) from y to u, actuators x sensors.
  Eigen::MatrixXcd response(double frequency_hz) const;

  /// C as one state space, for tests of the loop.
  ControllerStateSpace realization() const;

 private:
  bool lane_acts(Eigen::Index lane) const noexcept;
  void add_sections(const MotionControllerSpec& spec);
  void add_state_space(const ControllerStateSpace& given);
  void add_feed_forward(double* u) noexcept;
  void update_state_space(const double* y, double* u) noexcept;

  double sample_rate_hz_ = 0.0;
  Eigen::MatrixXd sensor_decoupling_;    // with one row and
  Eigen::MatrixXd actuator_decoupling_;  // one column per transfer function
  // Axes and transfer functions are in parallel lanes of one vector register. All are padded to the same number of
  // sections with sections of gain 1.
  Eigen::Index sections_ = 0;
  Eigen::ArrayXXd sensor_columns_;    // padded lanes x sensors
  Eigen::ArrayXXd coefficients_;      // padded lanes x 5 per section: b0 b1 b2 a1 a2
  Eigen::ArrayXXd state_;             // padded lanes x 2 per section
  Eigen::ArrayXXd actuator_columns_;  // padded actuators x lanes
  Eigen::ArrayXd axis_;               // padded lanes
  ControllerStateSpace state_space_;
  Eigen::ArrayXXd system_columns_;  // [A B; -C -D], padded rows
  Eigen::ArrayXd system_input_;     // x, y
  Eigen::ArrayXd system_output_;    // x of the next sample, u
  Eigen::ArrayXd feed_forward_;
  std::uint64_t ramp_samples_ = 0;
  std::uint64_t ramp_done_ = 0;
};

}  // namespace stageid
