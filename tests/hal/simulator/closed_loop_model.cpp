#include "tests/hal/simulator/closed_loop_model.hpp"

#include <cmath>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

#include "hal/stage/motion_controller.hpp"

namespace stageid::test {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Propagation of one mode in the state [q; q' / v]: 2 x 3; columns: state, state, force. v makes the entries of order one,
// as the general matrix exponential requires.
MatrixXd propagation(const PlantMode& mode, double duration_s) {
  constexpr double kV = 1000.0;
  const double omega = 2.0 * std::numbers::pi * mode.natural_frequency_hz;
  MatrixXd m = MatrixXd::Zero(3, 3);
  m(0, 1) = kV;
  m(1, 0) = -omega * omega / kV;
  m(1, 1) = -2.0 * mode.damping_ratio * omega;
  m(1, 2) = 1.0 / kV;
  m *= duration_s;
  return matrix_exponential(m).topRows(2);
}

}  // namespace

MatrixXd matrix_exponential(const MatrixXd& m) { return m.exp(); }

// The states are those of the modes, then u[n-1], u[n-2], ... u[n-d-1].
DenseModel plant_model(const std::vector<PlantMode>& modes, double delay_s, double sample_rate_hz) {
  const auto count = static_cast<Index>(modes.size());
  const Index inputs = modes[0].actuator_shape.size();
  const Index outputs = modes[0].sensor_shape.size();
  const double period_s = 1.0 / sample_rate_hz;
  const auto whole = static_cast<Index>(std::floor(delay_s / period_s));
  const double fraction = delay_s / period_s - static_cast<double>(whole);

  const Index n = 2 * count + inputs * (whole + 1);
  DenseModel s{MatrixXd::Zero(n, n), MatrixXd::Zero(n, inputs), MatrixXd::Zero(outputs, n)};
  const auto past = [&](Index steps) { return 2 * count + inputs * (steps - 1); };
  for (Index i = 0; i < count; ++i) {
    const PlantMode& mode = modes[i];
    const MatrixXd early = propagation(mode, fraction * period_s);
    const MatrixXd late = propagation(mode, (1.0 - fraction) * period_s);
    const MatrixXd free = late.leftCols(2);
    const MatrixXd shape = mode.actuator_shape.transpose();
    const MatrixXd forced = free * early;
    s.a.block(2 * i, 2 * i, 2, 2) = forced.leftCols(2);
    s.a.block(2 * i, past(whole + 1), 2, inputs) += forced.col(2) * shape;
    const MatrixXd of_new = late.col(2) * shape;
    if (whole == 0) {
      s.b.middleRows(2 * i, 2) = of_new;
    } else {
      s.a.block(2 * i, past(whole), 2, inputs) += of_new;
    }
    s.c.col(2 * i) = mode.sensor_shape;
  }
  s.b.middleRows(past(1), inputs).setIdentity();
  for (Index k = 2; k <= whole + 1; ++k)
    s.a.block(past(k), past(k - 1), inputs, inputs).setIdentity();
  return s;
}

DenseModel closed_loop_model(const SimulatedSpec& spec) {
  const DenseModel plant =
      plant_model(plant_modes(spec.info, spec.plant), spec.info.delay_s, spec.info.sample_rate_hz);
  const ControllerStateSpace controller = MotionController(spec.controller).realization();
  const Index n1 = plant.a.rows();
  const Index n2 = controller.a.rows();
  const MatrixXd direct = controller.d * plant.c;
  const MatrixXd feedback = -plant.b;
  DenseModel loop{MatrixXd(n1 + n2, n1 + n2), MatrixXd::Zero(n1 + n2, plant.b.cols()),
                  MatrixXd::Zero(plant.c.rows(), n1 + n2)};
  loop.a << plant.a + feedback * direct, feedback * controller.c, controller.b * plant.c,
      controller.a;
  loop.b.topRows(n1) = plant.b;
  loop.c.leftCols(n1) = plant.c;
  return loop;
}

}  // namespace stageid::test
