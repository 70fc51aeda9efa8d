#include "frf/response/covariance_smoothing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace stageid {
namespace {

void require_smoothable(const FrfEstimate& frf, int lines) {
  const auto refuse = [](const std::string& why) {
    throw std::invalid_argument("smooth covariance: " + why);
  };
  if (lines < 1 || lines % 2 == 0)
    refuse(fmt::format("{} lines; give an odd number (the line and its neighbours)", lines));
  if (lines > frf.lines())
    refuse(fmt::format("{} lines of {} were requested; lower the number of lines", lines,
                       frf.lines()));
  if (frf.residual_covariance.size() == 0 || frf.input_factor.size() == 0)
    refuse("the noise covariance is unknown; measure two periods");
  if (frf.method == FrfMethod::lpm)
    refuse("method 'lpm' already estimates it from neighbouring bins; estimate with 'periodic'");
  if (frf.correlated_lines != 1.0)
    refuse("zippered lines already estimate it from their neighbours; omit the smoothing");
  if (frf.experiment_noise_ratio != 1.0)
    refuse(
        "the noise level differs between the experiments, so they have no common C_E; omit the "
        "smoothing");
  if (frf.covariance_lines != 1)
    refuse(fmt::format("it is already the mean of {} lines; estimate again from the logs",
                       frf.covariance_lines));
}

/// Sums in the same order for every line, so that the rounding of neighbours does not matter.
Eigen::MatrixXcd smoothed(const Eigen::MatrixXcd& columns, int lines) {
  Eigen::MatrixXcd result(columns.rows(), columns.cols());
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    const Eigen::Index first = std::clamp<Eigen::Index>(k - lines / 2, 0, columns.cols() - lines);
    result.col(k) = columns.middleCols(first, lines).rowwise().mean();
  }
  return result;
}

/// Recomputes the variances and, if present, the whole covariance: S kron C_E.
void propagate(FrfEstimate& frf) {
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_u = frf.n_inputs();
  const Eigen::Index n_c = n_y * n_u;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd C = output_covariance(frf, k);
    const Eigen::Map<const Eigen::MatrixXcd> S(frf.input_factor.col(k).data(), n_u, n_u);
    for (Eigen::Index j = 0; j < n_u; ++j)
      frf.noise_variance.col(k).segment(n_y * j, n_y) = S(j, j).real() * C.diagonal().real();
    if (frf.covariance.size() == 0) continue;
    Eigen::Map<Eigen::MatrixXcd> covariance(frf.covariance.col(k).data(), n_c, n_c);
    for (Eigen::Index l = 0; l < n_u; ++l)
      for (Eigen::Index j = 0; j < n_u; ++j)
        covariance.block(n_y * j, n_y * l, n_y, n_y) = S(j, l) * C;
  }
}

}  // namespace

FrfEstimate smooth_covariance(const FrfEstimate& frf, int lines) {
  require_smoothable(frf, lines);
  FrfEstimate result = frf;
  result.residual_covariance = smoothed(frf.residual_covariance, lines);
  result.noise_dof = frf.noise_dof * lines;
  result.covariance_lines = lines;
  propagate(result);
  return result;
}

}  // namespace stageid
