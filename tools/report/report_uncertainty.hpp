#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid::report {

/// The variance for the standard deviations on page and pictures. A view, valid during the lifetime of the estimate.
struct Uncertainty {
  const Eigen::MatrixXd* variance = nullptr;  ///< null: unknown
  const char* kind = "";                      ///< "total", "noise" or ""
  double dof = 0.0;                           ///< 0: unknown
};

/// The total variance if there are enough realizations, else that of the noise. With fewer than four degrees of freedom
/// (realizations minus one), the standard deviation of a value would itself be uncertain by half, and the band would be
/// ragged.
inline Uncertainty uncertainty(const FrfEstimate& frf) {
  const bool scarce = frf.total_dof > 0.0 && frf.total_dof < 4.0;
  if (frf.total_variance.size() > 0 && !(scarce && frf.noise_variance.size() > 0))
    return {&frf.total_variance, "total", frf.total_dof};
  if (frf.noise_variance.size() > 0) return {&frf.noise_variance, "noise", frf.noise_dof};
  return {};
}

}  // namespace stageid::report
