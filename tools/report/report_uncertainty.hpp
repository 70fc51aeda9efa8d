#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid::report {

/// The variance for the standard deviations on page and pictures: the total one if there are enough realizations, else
/// that of the noise. A view, valid during the lifetime of `frf`.
struct Uncertainty {
  const Eigen::MatrixXd* variance = nullptr;  ///< null: unknown
  const char* kind = "";                      ///< "total", "noise" or ""
  double dof = 0.0;                           ///< 0: unknown
};
Uncertainty uncertainty(const FrfEstimate& frf);

}  // namespace stageid::report
