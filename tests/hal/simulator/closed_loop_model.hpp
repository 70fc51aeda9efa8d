#pragma once

#include <Eigen/Core>

#include "tests/support/stages/simulated_spec.hpp"

namespace stageid::test {

/// The whole closed loop of a noise-free stage as one discrete-time system,
///   x[n+1] = a x[n] + b r[n],   y[n] = c x[n],
/// built with the general matrix exponential, without code of the simulator.
struct ClosedLoopModel {
  Eigen::MatrixXd a, b, c;
};

ClosedLoopModel closed_loop_model(const SimulatedSpec& spec);

}  // namespace stageid::test
