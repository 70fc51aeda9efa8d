#include "estimation/loop/loop_poles.hpp"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "acquisition/files/fail.hpp"
#include "estimation/modal/sampled_state_space.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

/// Whole samples of delay as states: u_j through d_j of them before the system, y_i through o_i behind it.
StateSpace with_delay_states(const SampledStateSpace& sampled) {
  const StateSpace& s = sampled.system;
  const Eigen::Index n = s.order();
  const Eigen::Index n_u = s.B.cols();
  const Eigen::Index n_y = s.C.rows();
  const Eigen::Index inputs = sampled.input_delay_samples.sum();
  StateSpace out;
  const Eigen::Index all = n + inputs + sampled.output_delay_samples.sum();
  out.A.setZero(all, all);
  out.B.setZero(all, n_u);
  out.C.setZero(n_y, all);
  out.D.setZero(n_y, n_u);
  // [A B; C D] of the system, with its inputs at the ends of their chains.
  Eigen::MatrixXd from(n + n_y, all + n_u);
  from.setZero();
  from.leftCols(n) << s.A, s.C;
  Eigen::Index place = n;
  for (Eigen::Index j = 0; j < n_u; ++j) {
    const auto delay = static_cast<Eigen::Index>(sampled.input_delay_samples[j]);
    const Eigen::Index end = delay == 0 ? all + j : place + delay - 1;
    from.col(end) << s.B.col(j), s.D.col(j);
    if (delay > 0) out.B(place, j) = 1.0;
    for (Eigen::Index i = 1; i < delay; ++i) out.A(place + i, place + i - 1) = 1.0;
    place += delay;
  }
  out.A.topRows(n) = from.topLeftCorner(n, all);
  out.B.topRows(n) = from.topRightCorner(n, n_u);
  for (Eigen::Index i = 0; i < n_y; ++i) {
    const auto delay = static_cast<Eigen::Index>(sampled.output_delay_samples[i]);
    const auto row = from.row(n + i);
    if (delay == 0) {
      out.C.row(i) = row.head(all);
      out.D.row(i) = row.tail(n_u);
      continue;
    }
    out.A.row(place) = row.head(all);
    out.B.row(place) = row.tail(n_u);
    for (Eigen::Index d = 1; d < delay; ++d) out.A(place + d, place + d - 1) = 1.0;
    place += delay;
    out.C(i, place - 1) = 1.0;
  }
  return out;
}

/// The transition of plant and controller states with y = C x - D T v, v = K(y).
Eigen::MatrixXd closed_loop(const StateSpace& plant, const LoopController& controller) {
  const StateSpace& k = controller.system;
  const Eigen::Index n = plant.order();
  const Eigen::MatrixXd& T = controller.actuators;
  const Eigen::MatrixXd through = plant.D * T;
  Eigen::MatrixXd to_y(plant.C.rows(), n + k.order());
  to_y << plant.C, -through * k.C;
  const Eigen::MatrixXd direct =
      Eigen::MatrixXd::Identity(plant.C.rows(), plant.C.rows()) + through * k.D;
  to_y = direct.partialPivLu().solve(to_y).eval();
  Eigen::MatrixXd to_v = k.D * to_y;
  to_v.rightCols(k.order()) += k.C;
  Eigen::MatrixXd out(n + k.order(), n + k.order());
  out.topRows(n) = -plant.B * T * to_v;
  out.topLeftCorner(n, n) += plant.A;
  out.bottomRows(k.order()) = k.B * to_y;
  out.bottomRightCorner(k.order(), k.order()) += k.A;
  return out;
}

int outside(const Eigen::VectorXcd& poles) {
  return static_cast<int>((poles.cwiseAbs().array() > 1.0 + kEigenvalueRounding).count());
}

}  // namespace

LoopPoles loop_poles(const AdditiveModel& model, const LoopController& controller) {
  const SampledStateSpace sampled = sampled_state_space(model);
  if (sampled.input_delay_samples.minCoeff() < 0)
    fail_request(
        "model: a delay is negative, so the poles of the loop are unknown; fit with '--delay "
        "estimate'");
  const Eigen::VectorXcd poles =
      balanced_eigenvalues(closed_loop(with_delay_states(sampled), controller));
  if (!poles.allFinite())
    fail_request("model: the poles of the loop with this controller are not finite");
  LoopPoles out;
  Eigen::Index outermost = 0;
  if (poles.size() > 0) out.largest_pole = poles.cwiseAbs().maxCoeff(&outermost);
  if (poles.size() > 0)
    out.pole_hz =
        std::abs(std::arg(poles[outermost])) / (2.0 * std::numbers::pi) * model.sample_rate_hz;
  out.unstable_closed_loop = outside(poles);
  if (controller.system.order() > 0)
    out.unstable_open_loop = outside(balanced_eigenvalues(controller.system.A));
  for (const StateBlock& block : sampled.system.blocks)
    if (std::abs(block.pole) > 1.0 + kEigenvalueRounding)
      out.unstable_open_loop += static_cast<int>(block.size);
  return out;
}

}  // namespace stageid
