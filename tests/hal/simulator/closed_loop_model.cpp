#include "tests/hal/simulator/closed_loop_model.hpp"

#include <cmath>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

#include "hal/stage/controller_sections.hpp"

namespace stageid::test {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

struct System {
  MatrixXd a, b, c, d;
};

// Propagation of one mode in the state [q; q' / v]: 2 x 3; columns: state, state, force.
MatrixXd propagation(const PlantMode& mode, double duration_s) {
  constexpr double kV = 1000.0;
  const double omega = 2.0 * std::numbers::pi * mode.natural_frequency_hz;
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  m(0, 1) = kV;
  m(1, 0) = -omega * omega / kV;
  m(1, 1) = -2.0 * mode.damping_ratio * omega;
  m(1, 2) = 1.0 / kV;
  const Eigen::Matrix3d e = (m * duration_s).exp();
  return e.topRows(2);
}

// Plant with delayed input: the states are those of the modes, then u[n-1], u[n-2], ... u[n-d-1].
System plant_system(const SimulatedSpec& spec) {
  const auto modes = plant_modes(spec.info, spec.plant);
  const auto count = static_cast<Index>(modes.size());
  const auto inputs = static_cast<Index>(spec.info.actuators.size());
  const auto outputs = static_cast<Index>(spec.info.sensors.size());
  const double period_s = 1.0 / spec.info.sample_rate_hz;
  const auto whole = static_cast<Index>(std::floor(spec.info.delay_s / period_s));
  const double fraction = spec.info.delay_s / period_s - static_cast<double>(whole);

  const Index n = 2 * count + inputs * (whole + 1);
  System s{MatrixXd::Zero(n, n), MatrixXd::Zero(n, inputs), MatrixXd::Zero(outputs, n),
           MatrixXd::Zero(outputs, inputs)};
  const auto past = [&](Index steps) { return 2 * count + inputs * (steps - 1); };
  for (Index i = 0; i < count; ++i) {
    const PlantMode& mode = modes[i];
    const MatrixXd early = propagation(mode, fraction * period_s);
    const MatrixXd late = propagation(mode, (1.0 - fraction) * period_s);
    s.a.block(2 * i, 2 * i, 2, 2) = late.leftCols(2) * early.leftCols(2);
    const MatrixXd of_old = late.leftCols(2) * early.col(2) * mode.actuator_shape.transpose();
    const MatrixXd of_new = late.col(2) * mode.actuator_shape.transpose();
    s.a.block(2 * i, past(whole + 1), 2, inputs) += of_old;
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

System series(const System& first, const System& second) {
  const Index n1 = first.a.rows();
  const Index n2 = second.a.rows();
  System s{MatrixXd::Zero(n1 + n2, n1 + n2), MatrixXd(n1 + n2, 1), MatrixXd(1, n1 + n2),
           second.d * first.d};
  s.a.topLeftCorner(n1, n1) = first.a;
  s.a.bottomLeftCorner(n2, n1) = second.b * first.c;
  s.a.bottomRightCorner(n2, n2) = second.a;
  s.b << first.b, second.b * first.d;
  s.c << second.d * first.c, second.c;
  return s;
}

// Controllable canonical form of one section.
System section_system(const BiquadSection& q) {
  System s{MatrixXd(2, 2), MatrixXd(2, 1), MatrixXd(1, 2), MatrixXd::Constant(1, 1, q.b0)};
  s.a << -q.a1, -q.a2, 1.0, 0.0;
  s.b << 1.0, 0.0;
  s.c << q.b1 - q.a1 * q.b0, q.b2 - q.a2 * q.b0;
  return s;
}

System controller_system(const MotionControllerSpec& spec) {
  std::vector<System> axes;
  Index states = 0;
  for (const AxisController& axis : spec.axes) {
    const auto sections = controller_sections(axis, spec.sample_rate_hz);
    System chain = section_system(sections[0]);
    for (std::size_t i = 1; i < sections.size(); ++i)
      chain = series(chain, section_system(sections[i]));
    states += chain.a.rows();
    axes.push_back(chain);
  }
  const auto count = static_cast<Index>(axes.size());
  System s{MatrixXd::Zero(states, states), MatrixXd::Zero(states, count),
           MatrixXd::Zero(count, states), MatrixXd::Zero(count, count)};
  Index row = 0;
  for (Index i = 0; i < count; ++i) {
    const System& axis = axes[i];
    const Index n = axis.a.rows();
    s.a.block(row, row, n, n) = axis.a;
    s.b.block(row, i, n, 1) = axis.b;
    s.c.block(i, row, 1, n) = axis.c;
    s.d(i, i) = axis.d(0, 0);
    row += n;
  }
  return {s.a, s.b * spec.sensor_decoupling, -spec.actuator_decoupling * s.c,
          -spec.actuator_decoupling * s.d * spec.sensor_decoupling};
}

}  // namespace

ClosedLoopModel closed_loop_model(const SimulatedSpec& spec) {
  const System plant = plant_system(spec);
  const System controller = controller_system(spec.controller);
  const Index n1 = plant.a.rows();
  const Index n2 = controller.a.rows();
  ClosedLoopModel loop{MatrixXd(n1 + n2, n1 + n2), MatrixXd::Zero(n1 + n2, plant.b.cols()),
                       MatrixXd::Zero(plant.c.rows(), n1 + n2)};
  loop.a << plant.a + plant.b * controller.d * plant.c, plant.b * controller.c,
      controller.b * plant.c, controller.a;
  loop.b.topRows(n1) = plant.b;
  loop.c.leftCols(n1) = plant.c;
  return loop;
}

}  // namespace stageid::test
