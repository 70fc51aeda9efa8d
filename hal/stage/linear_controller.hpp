#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

struct BiquadSection;

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

/// Sections of second order in series with the given transfer function.
/// @throws std::invalid_argument unless the coefficients are finite, the denominator is not zero, and the numerator has
/// at most its degree (causal)
std::vector<BiquadSection> transfer_sections(const ControllerTransfer& transfer);

}  // namespace stageid
