#include "estimation/model/cmif_deviation.hpp"

#include <Eigen/SVD>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace stageid {
namespace {

/// Factor of every element of the matrix whose singular values are computed, on line k, n_y x n_u.
Eigen::MatrixXd element_weights(const FrfEstimate& frf, CmifKind kind, Eigen::Index k) {
  Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(frf.n_outputs(), frf.n_inputs());
  if (kind == CmifKind::accelerance) {
    const double omega = 2.0 * std::numbers::pi * frf.frequency_hz[k];
    weights *= omega * omega;
  } else if (kind == CmifKind::whitened) {
    const Eigen::MatrixXd& noise =
        frf.noise_variance.size() > 0 ? frf.noise_variance : frf.total_variance;
    if (noise.size() == 0)
      throw std::invalid_argument(
          "CMIF: whitening needs variances, but the FRF has none; use accelerance");
    weights.reshaped() = noise.col(k).cwiseSqrt().cwiseInverse();
  }
  return weights;
}

}  // namespace

Eigen::MatrixXd cmif_deviation(const FrfEstimate& frf, CmifKind kind,
                               const Eigen::MatrixXd& variance) {
  if (variance.rows() != frf.response.rows() || variance.cols() != frf.response.cols())
    throw std::invalid_argument("CMIF: the variance must have the shape of the response");
  const Eigen::Index curves = std::min(frf.n_outputs(), frf.n_inputs());
  Eigen::MatrixXd deviation(curves, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXd weights = element_weights(frf, kind, k);
    const Eigen::MatrixXcd G = frf.at(k).cwiseProduct(weights.cast<std::complex<double>>());
    const Eigen::Map<const Eigen::MatrixXd> raw(variance.col(k).data(), G.rows(), G.cols());
    const Eigen::MatrixXd V = raw.cwiseProduct(weights.cwiseAbs2());
    const Eigen::JacobiSVD<Eigen::MatrixXcd> svd(G, Eigen::ComputeThinU | Eigen::ComputeThinV);
    for (Eigen::Index i = 0; i < curves; ++i) {
      const double s = svd.singularValues()[i];
      const double spread =
          svd.matrixU().col(i).cwiseAbs2().dot(V * svd.matrixV().col(i).cwiseAbs2());
      deviation(i, k) = std::sqrt(2.0 * s * s * spread);
    }
  }
  return deviation;
}

}  // namespace stageid
