#include "frf/wiring/connected_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kOverNoise = 4.0;
constexpr double kLeastPower = 0.01;
constexpr int kScalings = 50;

/// Reciprocal size of each channel, such that rows and columns of D_y |G| D_u have the same power.
struct Scaling {
  Eigen::VectorXd outputs;
  Eigen::VectorXd inputs;
};

Eigen::VectorXd inverse_root(const Eigen::VectorXd& power) {
  return power.unaryExpr([](double p) { return p > 0.0 ? 1.0 / std::sqrt(p) : 0.0; });
}

Scaling scaling_of(const Eigen::MatrixXd& power) {
  Scaling s{Eigen::VectorXd::Ones(power.rows()), Eigen::VectorXd::Ones(power.cols())};
  const auto rows = static_cast<double>(power.rows());
  const auto columns = static_cast<double>(power.cols());
  for (int i = 0; i < kScalings; ++i) {
    s.outputs = inverse_root(power * s.inputs.cwiseAbs2() / columns);
    s.inputs = inverse_root(power.transpose() * s.outputs.cwiseAbs2() / rows);
  }
  return s;
}

/// All channels reachable from output `first`.
ConnectedBlock block_of(Index first, const Eigen::MatrixXi& connects) {
  std::vector<char> has_output(connects.rows(), 0);
  std::vector<char> has_input(connects.cols(), 0);
  has_output[first] = 1;
  for (bool grows = true; grows;) {
    grows = false;
    for (Index i = 0; i < connects.rows(); ++i)
      for (Index j = 0; j < connects.cols(); ++j) {
        char& output = has_output[i];
        char& input = has_input[j];
        if (connects(i, j) == 0 || output == input) continue;
        output = input = 1;
        grows = true;
      }
  }
  ConnectedBlock block;
  for (Index i = 0; i < connects.rows(); ++i)
    if (has_output[i] != 0) block.outputs.push_back(i);
  for (Index j = 0; j < connects.cols(); ++j)
    if (has_input[j] != 0) block.inputs.push_back(j);
  return block;
}

}  // namespace

std::vector<ConnectedBlock> connected_blocks(const std::vector<PlantLine>& lines) {
  if (lines.empty()) return {};
  const Index n_y = lines.front().G.rows();
  const Index n_u = lines.front().G.cols();
  Eigen::MatrixXd power = Eigen::MatrixXd::Zero(n_y, n_u);
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(n_y, n_u);
  for (const PlantLine& line : lines) {
    const double size = std::max(line.G.squaredNorm(), 1e-300);
    power += line.G.cwiseAbs2() / size;
    noise += line.variance / size;
  }
  // Sizes are those of the response without its noise, so channels without response do not count.
  Eigen::MatrixXd above = (power.array() > kOverNoise * noise.array())
                              .select(power - noise, Eigen::MatrixXd::Zero(n_y, n_u));
  const Scaling scaling = scaling_of(above);
  const Eigen::MatrixXd scaled =
      scaling.outputs.cwiseAbs2().asDiagonal() * above * scaling.inputs.cwiseAbs2().asDiagonal();
  const Eigen::MatrixXi connects = (scaled.array() > kLeastPower).cast<int>();
  std::vector<ConnectedBlock> blocks;
  std::vector<char> done(n_y, 0);
  for (Index i = 0; i < n_y; ++i) {
    if (done[i] != 0) continue;
    ConnectedBlock block = block_of(i, connects);
    for (const Index output : block.outputs) done[output] = 1;
    if (block.inputs.empty()) continue;
    const Eigen::VectorXd y = scaling.outputs(block.outputs);
    const Eigen::VectorXd u = scaling.inputs(block.inputs);
    for (const PlantLine& line : lines) {
      PlantLine part;
      part.omega_rad_s = line.omega_rad_s;
      part.G =
          y.asDiagonal() * Eigen::MatrixXcd(line.G(block.outputs, block.inputs)) * u.asDiagonal();
      part.variance = y.cwiseAbs2().asDiagonal() *
                      Eigen::MatrixXd(line.variance(block.outputs, block.inputs)) *
                      u.cwiseAbs2().asDiagonal();
      block.lines.push_back(std::move(part));
    }
    blocks.push_back(std::move(block));
  }
  return blocks;
}

}  // namespace stageid
