#include "frf/plant/realization_scatter.hpp"

namespace stageid {

double harmonic_mean(const Eigen::VectorXd& dof) {
  return dof.maxCoeff() > dof.minCoeff() ? 1.0 / dof.cwiseInverse().mean() : dof[0];
}

ScatterAverage::ScatterAverage(Eigen::Index outputs, Eigen::Index inputs, Eigen::Index lines) {
  mean_.setZero(outputs * inputs, lines);
  scatter_.setZero(outputs * inputs, lines);
  weight_.setZero(outputs * inputs, lines);
  residual_.setZero(outputs, lines);
  dof_.setZero(lines);
}

void ScatterAverage::add(const LineEstimate& line, const LineNoise& noise,
                         const Eigen::VectorXd& level, double dof, Eigen::Index k) {
  const Eigen::Index outputs = residual_.rows();
  residual_.col(k) += dof * noise.residual.diagonal().real().cwiseQuotient(level);
  dof_[k] += dof;
  // West's recursion: Welford's with weights.
  for (Eigen::Index c = 0; c < weight_.rows(); ++c) {
    const double weight = 1.0 / (level[c % outputs] * noise.gain(c % outputs, c / outputs));
    weight_(c, k) += weight;
    const double share = weight / weight_(c, k);
    const std::complex<double> deviation = line.G.data()[c] - mean_(c, k);
    mean_(c, k) += share * deviation;
    scatter_(c, k) += weight * (1.0 - share) * std::norm(deviation);
  }
}

RealizationScatter ScatterAverage::finish(int realizations) const {
  const Eigen::Index outputs = residual_.rows();
  const Eigen::MatrixXd residual = residual_ * dof_.cwiseInverse().asDiagonal();
  RealizationScatter found;
  found.total = scatter_.cwiseQuotient(weight_) / (realizations - 1.0);
  found.noise = residual.replicate(weight_.rows() / outputs, 1).cwiseQuotient(weight_);
  found.noise_dof = harmonic_mean(dof_);
  return found;
}

}  // namespace stageid
