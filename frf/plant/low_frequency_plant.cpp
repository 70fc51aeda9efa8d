#include "frf/plant/low_frequency_plant.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "excitation/decompositions/decompositions.hpp"
#include "frf/response/rigid_lines.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double kSmallestMotion = 1e-6;  // of the largest

double omega_of(double frequency_hz) { return 2.0 * std::numbers::pi * frequency_hz; }

/// Projects onto the motions of the channels that are possible for a rigid body.
MatrixXd onto_range(const MatrixXd& motions) {
  Eigen::BDCSVD<MatrixXd> parts = svd(motions, Eigen::ComputeThinU);
  parts.setThreshold(kSmallestMotion);
  const MatrixXd U = parts.matrixU().leftCols(parts.rank());
  return U * U.transpose();
}

}  // namespace

LowFrequencyPlant::LowFrequencyPlant(const FrfEstimate& frf, double delay_s,
                                     const MatrixXd& output_motions, const MatrixXd& input_motions)
    : delay_s_(delay_s) {
  const Index K =
      std::clamp(rigid_lines(frf.frequency_hz, frf.response.colwise().norm().transpose()),
                 std::min(kFewestRigidLines, frf.lines()), frf.lines());
  const Index n_y = frf.n_outputs();
  const Index n_u = frf.n_inputs();
  const Index terms = std::min<Index>(3, K);
  scale_rad_s_ = omega_of(frf.frequency_hz[K - 1]);
  Eigen::MatrixXcd G(n_y * n_u, K);
  MatrixXd X(K, terms);
  for (Index k = 0; k < K; ++k) {
    const double omega = omega_of(frf.frequency_hz[k]);
    const double x = -std::pow(omega / scale_rad_s_, 2);
    G.col(k) = frf.response.col(k) * std::polar(1.0, omega * delay_s_);
    for (Index t = 0; t < terms; ++t) X(k, t) = std::pow(x, static_cast<double>(t) - 1.0);
  }
  terms_.setZero(3, n_y * n_u);
  for (Index c = 0; c < n_y * n_u; ++c) {
    Eigen::VectorXd w(K);
    for (Index k = 0; k < K; ++k) {
      const Eigen::Map<const Eigen::MatrixXcd> whole(G.col(k).data(), n_y, n_u);
      const double row = whole.row(c % n_y).squaredNorm() / static_cast<double>(n_u);
      const double noise = frf.noise_variance.size() > 0 ? 0.5 * frf.noise_variance(c, k) : 0.0;
      const double variance = noise + kRigidModelError * kRigidModelError * row;
      w[k] = variance > 0.0 && std::isfinite(variance) ? 1.0 / std::sqrt(variance) : 0.0;
    }
    const Eigen::VectorXd target = w.cwiseProduct(G.row(c).real().transpose());
    terms_.col(c).head(terms) = least_squares(pivoted_qr(w.asDiagonal() * X), target);
  }
  const Eigen::VectorXd constant = terms_.row(0);
  const MatrixXd B = onto_range(output_motions) *
                     Eigen::Map<const MatrixXd>(constant.data(), n_y, n_u) *
                     onto_range(input_motions);
  terms_.row(0) = B.reshaped().transpose();
  double square = 0.0;
  for (Index k = 0; k < K; ++k)
    square += (response(frf.frequency_hz[k]) - frf.response.col(k)).squaredNorm() /
              std::max(frf.response.col(k).squaredNorm(), std::numeric_limits<double>::min());
  misfit_ = std::sqrt(square / static_cast<double>(K));
}

Eigen::VectorXcd LowFrequencyPlant::response(double frequency_hz) const {
  const double omega = omega_of(frequency_hz);
  const double x = -std::pow(omega / scale_rad_s_, 2);
  const Eigen::RowVector3d powers(1.0 / x, 1.0, x);
  return std::polar(1.0, -omega * delay_s_) *
         (powers * terms_).transpose().cast<std::complex<double>>();
}

}  // namespace stageid
