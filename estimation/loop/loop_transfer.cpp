#include "estimation/loop/loop_transfer.hpp"

#include <Eigen/LU>
#include <numbers>

#include "acquisition/files/fail.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {

Eigen::MatrixXcd controller_response(const LoopController& controller, double frequency_hz,
                                     double sample_rate_hz) {
  const StateSpace& K = controller.system;
  if (K.order() == 0) return K.D.cast<std::complex<double>>();
  const Eigen::Index n = K.order();
  const std::complex<double> z =
      std::polar(1.0, 2.0 * std::numbers::pi * frequency_hz / sample_rate_hz);
  const Eigen::MatrixXcd M = z * Eigen::MatrixXcd::Identity(n, n) - K.A;
  return K.C * solve(M, K.B.cast<std::complex<double>>()) + K.D;
}

LoopPoint loop_point(const LoopController& controller, const Eigen::MatrixXcd& K,
                     const Eigen::MatrixXcd& P, bool with_weights) {
  const Eigen::Index loops = controller.actuators.cols();
  const Eigen::MatrixXcd return_difference =
      Eigen::MatrixXcd::Identity(loops, loops) + K * P * controller.actuators;
  const Eigen::PartialPivLU<Eigen::MatrixXcd> factors(return_difference);
  const Eigen::MatrixXcd S = factors.inverse();
  LoopPoint out{S.diagonal().cwiseInverse().array() - 1.0, factors.determinant()};
  if (!with_weights) return out;
  const Eigen::MatrixXcd SK = S * K;
  const Eigen::MatrixXcd TS = controller.actuators * S;
  out.weights.resize(P.size(), loops + 1);
  for (Eigen::Index k = 0; k < loops; ++k) {
    const std::complex<double> scale = 1.0 / (S(k, k) * S(k, k));
    out.weights.col(k) = (scale * SK.row(k).transpose() * TS.col(k).transpose()).reshaped();
  }
  out.weights.col(loops) = (out.determinant * (controller.actuators * SK).transpose()).reshaped();
  return out;
}

std::vector<LoopPoint> loop_points(const AdditiveModel& model, const LoopController& controller,
                                   const Eigen::VectorXd& frequency_hz, bool with_weights) {
  const StateSpace& K = controller.system;
  if (controller.actuators.rows() != model.n_inputs() || K.D.cols() != model.n_outputs() ||
      K.D.rows() != controller.actuators.cols())
    fail_request("controller: {} x {}; the model needs {} x {}", controller.actuators.rows(),
                 K.D.cols(), model.n_inputs(), model.n_outputs());
  const Eigen::MatrixXcd P = response(model, frequency_hz, HoldModel::exact);
  std::vector<LoopPoint> out;
  for (Eigen::Index k = 0; k < frequency_hz.size(); ++k)
    out.push_back(loop_point(controller,
                             controller_response(controller, frequency_hz[k], model.sample_rate_hz),
                             P.col(k).reshaped(model.n_outputs(), model.n_inputs()), with_weights));
  return out;
}

}  // namespace stageid
