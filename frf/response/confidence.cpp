#include "frf/response/confidence.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "acquisition/files/fail.hpp"

namespace stageid {

double squared_error_quantile(double level, double dof) {
  const double known = -std::log1p(-level);
  // expm1 avoids cancellation for many degrees of freedom.
  return dof > 0.0 ? dof * std::expm1(known / dof) : known;
}

Eigen::MatrixXd confidence_radius(const FrfEstimate& frf, double level, VarianceKind kind) {
  if (!(level > 0.0 && level < 1.0))
    fail_request("confidence level: {} is out of range; give a probability between 0 and 1", level);
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
  return (squared_error_quantile(level, dof) * variance).cwiseSqrt();
}

double mean_relative_variance(const FrfEstimate& frf, VarianceKind kind) {
  const Eigen::MatrixXd& variance =
      kind == VarianceKind::noise ? frf.noise_variance : frf.total_variance;
  if (variance.size() == 0)
    throw std::invalid_argument(
        kind == VarianceKind::noise
            ? "relative variance: the noise is unknown; measure two periods"
            : "relative variance: the total variance is unknown; measure two realizations");
  double sum = 0.0;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::Map<const Eigen::MatrixXd> line(variance.col(k).data(), frf.n_outputs(),
                                                 frf.n_inputs());
    const Eigen::VectorXd size = frf.at(k).rowwise().squaredNorm();
    if (!(size.minCoeff() > 0.0))
      fail_request(
          "relative variance: the response of an output is zero at {} Hz; exclude this "
          "line or output",
          frf.frequency_hz[k]);
    sum += (line.rowwise().sum().array() / size.array()).mean();
  }
  return sum / static_cast<double>(frf.lines());
}

std::optional<double> worst_relative_variance(const FrfEstimate& frf) {
  double variance = 0.0;
  if (frf.noise_variance.size() > 0) variance = mean_relative_variance(frf, VarianceKind::noise);
  if (frf.total_variance.size() > 0)
    variance = std::max(variance, mean_relative_variance(frf, VarianceKind::total));
  return variance > 0.0 ? std::optional(variance) : std::nullopt;
}

}  // namespace stageid
