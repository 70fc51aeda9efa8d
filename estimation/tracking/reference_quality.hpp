#pragma once

#include <Eigen/Core>

namespace stageid {

/// How well the model explains the periods from which the reference was learned.
struct ReferenceQuality {
  /// Mean square of the constant residual, relative to noise alone: 1 for an exact model, by sensor.
  Eigen::VectorXd chi_square;
  /// rms over the lines of the constant residual relative to the output, without noise.
  Eigen::VectorXd relative_error;
  /// The same of the model itself, without tracked changes.
  Eigen::VectorXd model_error;
};

}  // namespace stageid
