#include "frf/response/distortion_variance.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "frf/response/channel_tiles.hpp"
#include "frf/statistics/frequency_bands.hpp"

namespace stageid {
namespace {

constexpr int kPasses = 5;  // of the weights: alpha changes by less than a percent afterwards

/// Mean over the inputs of |G|^2, n_y x N. With one input, only of the channels of this process.
Eigen::MatrixXd row_power(const FrfEstimate& frf) {
  const Eigen::Index n_y = frf.n_outputs();
  const auto [first, count] = frf.own();
  Eigen::MatrixXd power(n_y, frf.lines());
  if (frf.n_inputs() == 1) {
    power.middleRows(first, count) = frf.response.middleRows(first, count).cwiseAbs2();
    return power;
  }
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    std::vector<Eigen::VectorXd> parts;  // one per input, so that any team sums in one order
    for (Eigen::Index c = first, rows = 0; c < first + count; c += rows) {
      rows = std::min(first + count - c, n_y - c % n_y);
      parts.emplace_back(Eigen::VectorXd::Zero(n_y)).segment(c % n_y, rows) =
          frf.response.col(k).segment(c, rows).cwiseAbs2();
    }
    power.col(k) = frf.team->sum(channel_tiles(frf.response.rows()), n_y, parts) /
                   static_cast<double>(frf.n_inputs());
  }
  return power;
}

/// alpha of one channel in one band. @param power row_power()
double relative_distortion(const Eigen::ArrayXd& total, const Eigen::ArrayXd& noise,
                           const Eigen::ArrayXd& power) {
  if (!(power.sum() > 0.0)) return 0.0;
  const Eigen::ArrayXd excess = total - noise;
  double alpha = std::max(0.0, excess.sum() / power.sum());
  for (int pass = 0; pass < kPasses; ++pass) {
    const Eigen::ArrayXd v = noise + alpha * power;
    if (!(v.minCoeff() > 0.0)) return alpha;
    alpha = std::max(0.0, (power * excess / v.square()).sum() / (power / v).square().sum());
  }
  return alpha;
}

}  // namespace

DistortionVariance distortion_variance(const FrfEstimate& frf) {
  const std::vector<IndexRange> bands = octave_bands(frf.frequency_hz);
  DistortionVariance out;
  out.variance.resize(frf.response.rows(), frf.lines());
  const Eigen::MatrixXd row = row_power(frf);
  const auto [first, count] = frf.own();
  const auto prior_dof = static_cast<double>(kFewestLinesOfBand);  // of the expectation
  out.dof = frf.total_dof + prior_dof;
  out.distortion.band_hz.resize(std::ssize(bands), 2);
  out.distortion.level.resize(frf.response.rows(), std::ssize(bands));
  for (Eigen::Index b = 0; b < std::ssize(bands); ++b) {
    const IndexRange& lines = bands[b];
    out.distortion.band_hz.row(b) << frf.frequency_hz[lines.first], frf.frequency_hz[lines.end - 1];
    for (Eigen::Index c = first; c < first + count; ++c) {
      const auto band = [&](const Eigen::MatrixXd& matrix, Eigen::Index i) {
        return matrix.row(i).segment(lines.first, lines.count()).transpose().array().eval();
      };
      const Eigen::ArrayXd total = band(frf.total_variance, c);
      const Eigen::ArrayXd noise = band(frf.noise_variance, c);
      const Eigen::ArrayXd power = band(row, c % frf.n_outputs());
      const double alpha = relative_distortion(total, noise, power);
      out.distortion.level(c, b) = std::sqrt((frf.total_dof + 1.0) * alpha);
      const Eigen::ArrayXd expected = noise + alpha * power;
      out.variance.row(c).segment(lines.first, lines.count()) =
          ((frf.total_dof * total + prior_dof * expected) / out.dof).matrix().transpose();
    }
  }
  frf.team->gather_rows(kTileChannels, out.distortion.level);
  return out;
}

Eigen::MatrixXcd covariance_with_distortion(const FrfEstimate& frf,
                                            const Eigen::MatrixXd& variance) {
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_u = frf.n_inputs();
  const auto scaled = [](const Eigen::MatrixXcd& C, const Eigen::ArrayXd& power) {
    const Eigen::ArrayXd diagonal = C.diagonal().real().array();
    const Eigen::ArrayXd scale = (diagonal > 0.0).select((power / diagonal).sqrt(), 0.0);
    return Eigen::MatrixXcd(scale.matrix().asDiagonal() * C * scale.matrix().asDiagonal());
  };
  Eigen::MatrixXcd out(n_y * n_y, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd G = frf.response.col(k).reshaped(n_y, n_u);
    const Eigen::ArrayXd noise = frf.noise_variance.col(k).reshaped(n_y, n_u).rowwise().mean();
    const Eigen::ArrayXd total = variance.col(k).reshaped(n_y, n_u).rowwise().mean();
    const Eigen::MatrixXcd C = scaled(output_covariance(frf, k), noise) +
                               scaled(G * G.adjoint(), (total - noise).max(0.0));
    out.col(k) = C.reshaped();
  }
  return out;
}

Eigen::MatrixXd variance_with(const Distortion& distortion, const FrfEstimate& frf) {
  Eigen::MatrixXd variance = frf.noise_variance;
  const Eigen::MatrixXd row = row_power(frf);
  const double realizations = std::max(1, frf.realizations);
  Eigen::Index b = 0;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    while (b + 1 < distortion.band_hz.rows() && frf.frequency_hz[k] >= distortion.band_hz(b + 1, 0))
      ++b;
    variance.col(k) += (distortion.level.col(b).array().square() *
                        row.col(k).replicate(frf.n_inputs(), 1).array() / realizations)
                           .matrix();
  }
  return variance;
}

}  // namespace stageid
