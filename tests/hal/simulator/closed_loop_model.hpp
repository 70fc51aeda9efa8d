#pragma once

#include <Eigen/Core>
#include <vector>

#include "tests/support/stages/simulated_spec.hpp"

namespace stageid::test {

/// x[n+1] = a x[n] + b u[n],   y[n] = c x[n], without code of the simulator.
struct DenseModel {
  Eigen::MatrixXd a, b, c;
};

Eigen::MatrixXd matrix_exponential(const Eigen::MatrixXd& m);

/// A plant behind a delay, by the matrix exponential of each mode. Continuous time is divided at the sample instants and
/// at the jumps of the input, for any number of jumps between two samples.
DenseModel plant_model(const std::vector<PlantMode>& modes, double delay_s, double sample_rate_hz);

/// The whole closed loop of a noise-free stage; u is the excitation.
DenseModel closed_loop_model(const SimulatedSpec& spec);

}  // namespace stageid::test
