#include "hal/simulator/mode_transition.hpp"

namespace stageid {

// In the time unit of one halved step h the state is x = [q; h q'], x' = A x + [0; h^2 f]. With
//   E(h) = e^A,   F(h) = int_0^1 e^(A s) ds,
// two steps make E(2h) = E^2 and F(2h) = (I + E) F in the same unit.
ModeTransition mode_transition(double omega_rad_s, double damping_ratio, double duration_s) {
  if (duration_s == 0.0) return {Eigen::Matrix2d::Identity(), Eigen::Vector2d::Zero()};
  const double rate = omega_rad_s * (1.0 + damping_ratio);
  int doublings = 0;
  double h = duration_s;
  while (rate * h > 0.25) {
    h *= 0.5;
    ++doublings;
  }
  const double wh = omega_rad_s * h;
  Eigen::Matrix2d a;
  a << 0.0, 1.0, -wh * wh, -2.0 * damping_ratio * wh;

  constexpr int kTerms = 25;  // the norm of A is about 1, and 1/25! = 6e-26
  Eigen::Matrix2d e = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d integral = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d power = Eigen::Matrix2d::Identity();  // A^k / k!
  for (int k = 1; k <= kTerms; ++k) {
    power = power * a / k;
    e += power;
    integral += power / (k + 1.0);
  }
  for (int i = 0; i < doublings; ++i) {
    integral += e * integral;
    e = e * e;
  }
  ModeTransition mode;
  mode.transition << e(0, 0), e(0, 1) * h, e(1, 0) / h, e(1, 1);
  mode.input << integral(0, 1) * h * h, integral(1, 1) * h;
  return mode;
}

}  // namespace stageid
