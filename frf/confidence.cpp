#include "frf/confidence.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace stageid {

Eigen::MatrixXd confidence_radius(const FrfEstimate& frf, double level, VarianceKind kind) {
  if (!(level > 0.0 && level < 1.0)) {
    throw std::invalid_argument(
        fmt::format("confidence level: {}; a probability between 0 and 1 belongs there", level));
  }
  const bool total = kind == VarianceKind::total;
  const Eigen::MatrixXd& variance = total ? frf.total_variance : frf.noise_variance;
  const double dof = total ? frf.total_dof : frf.noise_dof;
  if (variance.size() == 0 || !(dof > 0.0)) {
    throw std::invalid_argument(
        total ? "confidence radius: the total variance or its total_dof is unknown; measure two "
                "realizations"
              : "confidence radius: the noise variance or its noise_dof is unknown; measure two "
                "periods");
  }
  // expm1: many degrees of freedom leave little of the difference.
  const double quantile = dof * std::expm1(-std::log1p(-level) / dof);
  return (quantile * variance).cwiseSqrt();
}

}  // namespace stageid
