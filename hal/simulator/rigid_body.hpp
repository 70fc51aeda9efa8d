#pragma once

#include <Eigen/Core>
#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include "hal/stage/limits.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// The six degrees of freedom of a rigid stage, in this order everywhere: translations, then rotations about
/// the same axes through the centre of mass.
inline constexpr std::size_t kRigidAxes = 6;
inline constexpr std::array<const char*, kRigidAxes> kRigidAxisNames = {"x",  "y",  "z",
                                                                        "Rx", "Ry", "Rz"};

/// Row c = [d_c^T, (p_c x d_c)^T], with position p_c and direction d_c of channel c: channels x 6.
/// Of a rotation or torque: [0, d_c^T]. Times the gain of the channel.
/// As sensors the channels measure J q for a small rigid motion q; as actuators their values u give
/// the wrench J^T u about the centre of mass.
Eigen::MatrixXd rigid_body_jacobian(const std::vector<Channel>& channels);

/// Builds the decoupled six-axis controller of a stage from the geometry of its channels:
///   T_y = J_y^+  (6 x sensors),   T_u = (J_u^T)^+  (actuators x 6),
/// without sensors of acceleration: the least-squares estimate of the rigid motion and the smallest forces with a given wrench.
///
/// An axis with crossover_hz 0 is open. A gain of 0 is replaced by the gain with which the open loop of the
/// free rigid axis, C(s) / (inertia s^2), has magnitude 1 at crossover_hz.
///
/// @param axes in the order of kRigidAxisNames.
/// @param axis_inertia mass (three times) in kg, then the inertias about x, y, z in kg m^2.
/// @throws std::invalid_argument if the sensors or actuators cannot measure or control a closed axis
///         independently of the other axes; if an inertia of a closed axis is not positive; or for
///         values that MotionController refuses.
MotionControllerSpec motion_controller_spec(double sample_rate_hz,
                                            const std::vector<Channel>& actuators,
                                            const std::vector<Channel>& sensors,
                                            const std::array<AxisController, kRigidAxes>& axes,
                                            const std::array<double, kRigidAxes>& axis_inertia);

/// The motion by which a controller moves the stage. The inertia of a closed axis is derived from the controller: its
/// open loop C(s) / (inertia s^2) has magnitude 1 at crossover_hz. A controller without axes needs the inertia of all
/// rigid axes; its bandwidth is the lowest frequency at which a loop with the free rigid stage has gain 1.
/// Empty if there is no closed axis, or nothing is known.
/// @param axis_inertia as in motion_controller_spec(); zeros: unknown
RigidMotion rigid_motion(const MotionControllerSpec& controller,
                         const std::vector<Channel>& actuators, const std::vector<Channel>& sensors,
                         const std::array<double, kRigidAxes>& axis_inertia = {});

/// C(j 2 pi frequency_hz) of one axis in continuous time, with the given gain.
std::complex<double> axis_response(const AxisController& axis, double frequency_hz);

}  // namespace stageid
