#pragma once

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <numbers>

#include "hal/simulator/modal_plant.hpp"
#include "hal/stage/motion_controller.hpp"

namespace stageid::test {

/// A cosine of `line` cycles per period of so many samples. The last of its periods is measured.
struct Cosine {
  int line, period, periods;
};

/// The response to `direction` times the cosine. @param step (input, output) of one sample
template <typename Step>
Eigen::VectorXcd measured_response(const Eigen::VectorXd& direction, Eigen::Index outputs,
                                   const Cosine& cosine, Step step) {
  Eigen::VectorXcd sum = Eigen::VectorXcd::Zero(outputs);
  Eigen::VectorXd output(outputs);
  for (int n = 0; n < cosine.periods * cosine.period; ++n) {
    const double angle = 2.0 * std::numbers::pi * cosine.line * n / cosine.period;
    const Eigen::VectorXd input = direction * std::cos(angle);
    step(input.data(), output.data());
    if (n >= (cosine.periods - 1) * cosine.period)
      sum += output * std::polar(2.0 / cosine.period, -angle);
  }
  return sum;
}

inline Eigen::VectorXcd measured_response(MotionController& controller,
                                          const Eigen::VectorXd& direction, const Cosine& cosine) {
  controller.reset();
  return measured_response(direction, controller.actuators(), cosine,
                           [&](const double* y, double* u) { controller.update(y, u); });
}

inline Eigen::VectorXcd measured_response(ModalPlant& plant, const Eigen::VectorXd& direction,
                                          const Cosine& cosine) {
  plant.reset();
  return measured_response(direction, plant.sensors(), cosine, [&](const double* u, double* y) {
    plant.output(y);  // y[n] before u[n]
    plant.step(u);
  });
}

}  // namespace stageid::test
