#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid::report {

/// The variance that the standard deviation of page and pictures stands for: the total one where enough
/// realizations tell it, else that of the noise. A view, valid while `frf` lives.
struct Uncertainty {
  const Eigen::MatrixXd* variance = nullptr;  ///< null: none is known
  const char* kind = "";                      ///< "total", "noise" or ""
  double dof = 0.0;                           ///< of it; 0: not known
};
Uncertainty uncertainty(const FrfEstimate& frf);

}  // namespace stageid::report
