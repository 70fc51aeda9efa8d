#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimation/loop/loop_margins.hpp"
#include "estimation/loop/loop_poles.hpp"

namespace stageid {

/// A model with the controller that closes its loop.
struct LoopView {
  LoopPoles poles;
  std::optional<MarginSet> margins;  ///< none: the loop is unstable
  Eigen::VectorXd frequency_hz;      ///< N lines
  Eigen::MatrixXcd loop;             ///< n_l x N: L_k with the other loops closed
  Eigen::VectorXcd determinant;      ///< N: det(I + L), the multivariable Nyquist curve
  /// Radii of discs that contain the true values with probability 0.95; empty: unknown.
  Eigen::MatrixXd loop_radius;         ///< n_l x N
  Eigen::VectorXd determinant_radius;  ///< N
};

/// @param covariance of all parameters, FitCovariance::sandwich; 0 x 0: unknown
/// @throws std::invalid_argument as loop_poles() and loop_margins()
LoopView loop_view(const AdditiveModel& model, const LoopController& controller,
                   const Eigen::MatrixXd& covariance, const Eigen::VectorXd& frequency_hz);

}  // namespace stageid
