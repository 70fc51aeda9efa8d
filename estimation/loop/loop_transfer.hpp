#pragma once

#include <Eigen/Core>
#include <complex>
#include <string>
#include <vector>

#include "estimation/modal/state_space.hpp"

namespace stageid {

/// A sampled controller in two factors, u = r - T K(z) y. Its loops are the signals between them.
struct LoopController {
  std::vector<std::string> loops;  ///< names, n_l
  Eigen::MatrixXd actuators;       ///< T, n_u x n_l
  StateSpace system;               ///< K at the sample rate of the model, n_l x n_y; without blocks
};

/// K(e^{j omega T}), n_l x n_y.
Eigen::MatrixXcd controller_response(const LoopController& controller, double frequency_hz,
                                     double sample_rate_hz);

/// The loop at one frequency. With L = K P T and S = (I + L)^-1,
///   L_k = 1 / S_kk - 1 is the transfer of loop k, opened alone, with the others closed, and
///   dL_k = e_k^T S K dP T S e_k / S_kk^2,   d det(I + L) = det(I + L) tr(S K dP T).
/// Source: S. Skogestad and I. Postlethwaite, Multivariable Feedback Control, 2nd ed. (2005), ch. 4 and 9;
/// J. M. Maciejowski, Multivariable Feedback Design (1989), ch. 2; docs/theory.md, section 15.
struct LoopPoint {
  Eigen::VectorXcd loop;             ///< L_k, n_l
  std::complex<double> determinant;  ///< det(I + L)
  Eigen::MatrixXcd weights = {};  ///< (n_y n_u) x (n_l + 1): of dL_k and d det by dP; if requested
};
LoopPoint loop_point(const LoopController& controller, const Eigen::MatrixXcd& K,
                     const Eigen::MatrixXcd& P, bool with_weights);

/// The loop of a model behind the exact hold, as a digital controller closes it, on given lines.
/// @throws std::invalid_argument if the sizes of model and controller differ, or the model has no sample rate
std::vector<LoopPoint> loop_points(const AdditiveModel& model, const LoopController& controller,
                                   const Eigen::VectorXd& frequency_hz, bool with_weights);

}  // namespace stageid
