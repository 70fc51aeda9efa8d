#include "frf/response/relative_variance.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace stageid {

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
      throw std::invalid_argument(
          fmt::format("relative variance: the response of an output is zero at {} Hz; exclude this "
                      "line or output",
                      frf.frequency_hz[k]));
    sum += (line.rowwise().sum().array() / size.array()).mean();
  }
  return sum / static_cast<double>(frf.lines());
}

}  // namespace stageid
