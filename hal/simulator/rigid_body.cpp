#include "hal/simulator/rigid_body.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "excitation/decompositions/decompositions.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

using std::numbers::pi;
using Jacobian = Eigen::MatrixXd;

// J^+ J projects onto the motions that the channels determine. It leaves an axis's unit vector unchanged if and
// only if they determine that axis. The row has no mixed units, unlike J^+.
void require_independent(const Jacobian& jacobian, const Eigen::MatrixXd& inverse,
                         Eigen::Index axis, const char* what) {
  constexpr double kTolerance = 1e-9;
  Eigen::RowVectorXd row = inverse.row(axis) * jacobian;
  row[axis] -= 1.0;
  require(!(row.cwiseAbs().maxCoeff() > kTolerance),
          "controller: axis {} is closed, but the {} cannot control it independently of the other "
          "axes; add {} or leave the axis open",
          kRigidAxisNames[axis], what, what);
}

// The gain that makes |C(j w_c)| / (inertia w_c^2) = 1.
double unit_crossover_gain(AxisController axis, double inertia, const char* name) {
  require(inertia > 0.0 && std::isfinite(inertia),
          "controller: axis {} has gain 0 (automatic), which needs a positive inertia; got {}. "
          "Write 'gain', or the inertia in 'plant'",
          name, inertia);
  axis.gain = 1.0;
  const double omega = 2.0 * pi * axis.crossover_hz;
  return inertia * omega * omega / std::abs(axis_response(axis, axis.crossover_hz));
}

/// Of sensors of the position. An acceleration does not determine it.
Jacobian position_jacobian(const std::vector<Channel>& sensors) {
  Jacobian jacobian = rigid_body_jacobian(sensors);
  for (std::size_t i = 0; i < sensors.size(); ++i)
    if (is_acceleration(sensors[i])) jacobian.row(i).setZero();
  return jacobian;
}

/// y - J q for the least-squares motion q. Empty if always zero: not more sensors than axes.
Eigen::MatrixXd contradiction_of(const Jacobian& jacobian, const Eigen::MatrixXd& inverse) {
  Eigen::MatrixXd rest =
      Eigen::MatrixXd::Identity(jacobian.rows(), jacobian.rows()) - jacobian * inverse;
  for (Eigen::Index i = 0; i < jacobian.rows(); ++i)
    if (jacobian.row(i).isZero(0.0)) rest(i, i) = 0.0;
  if (rest.cwiseAbs().maxCoeff() > 1e-9) return rest;
  return {};
}

/// The lowest frequency at which an eigenvalue of the loop gain with the rigid stage falls below 1; 0: none.
double lowest_crossover_hz(const MotionController& controller, double sample_rate_hz,
                           const Eigen::MatrixXd& acceleration_per_n) {
  const auto sizes = [&](double f) {
    const double omega = 2.0 * pi * f;
    const Eigen::MatrixXcd gain =
        (acceleration_per_n / (omega * omega)).cast<std::complex<double>>() *
        controller.response(f);
    return Eigen::VectorXd(eigenvalues(gain).cwiseAbs());
  };
  const double lowest_hz = 1e-5 * sample_rate_hz;
  const auto closed = (sizes(lowest_hz).array() > 1.0).count();
  if (closed == 0) return 0.0;
  const double ratio = std::pow(10.0, 1.0 / 50.0);
  for (double f = lowest_hz; f < 0.5 * sample_rate_hz; f *= ratio)
    if ((sizes(f).array() > 1.0).count() < closed) return f;
  return 0.0;
}

RigidMotion free_motion(const MotionController& controller, double sample_rate_hz,
                        const Jacobian& actuators, const Jacobian& sensors,
                        const std::array<double, kRigidAxes>& axis_inertia) {
  const Eigen::Map<const Eigen::Matrix<double, 6, 1>> inertia(axis_inertia.data());
  if (!(inertia.array() > 0.0).all() || !controller.acts()) return {};
  RigidMotion motion;
  motion.acceleration_per_n = sensors * inertia.cwiseInverse().asDiagonal() * actuators.transpose();
  motion.bandwidth_rad_s =
      2.0 * pi * lowest_crossover_hz(controller, sample_rate_hz, motion.acceleration_per_n);
  if (motion.bandwidth_rad_s == 0.0) return {};
  const Eigen::MatrixXd sensor_inverse = pseudo_inverse(sensors);
  motion.force_per_acceleration =
      pseudo_inverse(actuators).transpose() * inertia.asDiagonal() * sensor_inverse;
  motion.contradiction = contradiction_of(sensors, sensor_inverse);
  return motion;
}

}  // namespace

Eigen::MatrixXd rigid_body_jacobian(const std::vector<Channel>& channels) {
  Eigen::MatrixXd jacobian(static_cast<Eigen::Index>(channels.size()), 6);
  for (Eigen::Index row = 0; row < jacobian.rows(); ++row) {
    const Channel& channel = channels[row];
    const auto position = Eigen::Map<const Eigen::RowVector3d>(channel.position_m);
    const auto direction = Eigen::Map<const Eigen::RowVector3d>(channel.direction);
    if (is_rotation(channel)) {
      jacobian.row(row) << Eigen::RowVector3d::Zero(), direction;
    } else {
      jacobian.row(row) << direction, position.cross(direction);
    }
    jacobian.row(row) *= channel.gain;
  }
  return jacobian;
}

std::complex<double> axis_response(const AxisController& axis, double frequency_hz) {
  const std::complex<double> s(0.0, 2.0 * pi * frequency_hz);
  const auto omega = [](double hz) { return 2.0 * pi * hz; };
  std::complex<double> value = axis.gain;
  if (axis.integrator_hz > 0.0) value *= 1.0 + omega(axis.integrator_hz) / s;
  if (axis.lead_zero_hz > 0.0) value *= s / omega(axis.lead_zero_hz) + 1.0;
  if (axis.lead_pole_hz > 0.0) value /= s / omega(axis.lead_pole_hz) + 1.0;
  if (axis.lowpass_hz > 0.0) {
    const std::complex<double> x = s / omega(axis.lowpass_hz);
    value /= x * x + 2.0 * axis.lowpass_damping * x + 1.0;
  }
  for (const auto& notch : axis.notches) {
    const std::complex<double> x = s / omega(notch.frequency_hz);
    value *=
        (x * x + 2.0 * notch.zero_damping * x + 1.0) / (x * x + 2.0 * notch.pole_damping * x + 1.0);
  }
  return value;
}

MotionControllerSpec motion_controller_spec(double sample_rate_hz,
                                            const std::vector<Channel>& actuators,
                                            const std::vector<Channel>& sensors,
                                            const std::array<AxisController, kRigidAxes>& axes,
                                            const std::array<double, kRigidAxes>& axis_inertia) {
  const Jacobian actuator_jacobian = rigid_body_jacobian(actuators);
  const Jacobian sensor_jacobian = position_jacobian(sensors);
  const Eigen::MatrixXd actuator_inverse = pseudo_inverse(actuator_jacobian);
  const Eigen::MatrixXd sensor_inverse = pseudo_inverse(sensor_jacobian);

  MotionControllerSpec spec;
  spec.sample_rate_hz = sample_rate_hz;
  spec.sensor_decoupling = sensor_inverse;
  spec.actuator_decoupling = actuator_inverse.transpose();
  spec.axes.assign(axes.begin(), axes.end());
  for (std::size_t i = 0; i < kRigidAxes; ++i) {
    AxisController& axis = spec.axes[i];
    if (axis.crossover_hz == 0.0) continue;
    require_independent(sensor_jacobian, sensor_inverse, i, "sensors");
    require_independent(actuator_jacobian, actuator_inverse, i, "actuators");
    if (axis.gain == 0.0)
      axis.gain = unit_crossover_gain(axis, axis_inertia[i], kRigidAxisNames[i]);
  }
  static_cast<void>(MotionController(spec));  // checks the remaining values
  return spec;
}

RigidMotion rigid_motion(const MotionControllerSpec& controller,
                         const std::vector<Channel>& actuators, const std::vector<Channel>& sensors,
                         const std::array<double, kRigidAxes>& axis_inertia) {
  const Jacobian actuator_jacobian = rigid_body_jacobian(actuators);
  const Jacobian sensor_jacobian = position_jacobian(sensors);
  if (controller.axes.empty())
    return free_motion(MotionController(controller), controller.sample_rate_hz, actuator_jacobian,
                       sensor_jacobian, axis_inertia);
  RigidMotion motion;
  const auto add = [](Eigen::MatrixXd& sum, const Eigen::MatrixXd& term) {
    sum = sum.size() == 0 ? term : sum + term;
  };
  for (std::size_t i = 0; i < controller.axes.size(); ++i) {
    const AxisController& axis = controller.axes[i];
    if (axis.crossover_hz == 0.0) continue;
    const double omega = 2.0 * pi * axis.crossover_hz;
    const double inertia = std::abs(axis_response(axis, axis.crossover_hz)) / (omega * omega);
    motion.bandwidth_rad_s =
        motion.bandwidth_rad_s == 0.0 ? omega : std::min(motion.bandwidth_rad_s, omega);
    add(motion.acceleration_per_n,
        sensor_jacobian.col(i) * actuator_jacobian.col(i).transpose() / inertia);
    const double braked = axis.brake ? inertia : 0.0;
    add(motion.force_per_acceleration,
        braked * controller.actuator_decoupling.col(i) * controller.sensor_decoupling.row(i));
  }
  if (motion.bandwidth_rad_s > 0.0)
    motion.contradiction = contradiction_of(sensor_jacobian, controller.sensor_decoupling);
  return motion;
}

}  // namespace stageid
