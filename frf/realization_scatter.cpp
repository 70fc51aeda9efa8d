#include "frf/realization_scatter.hpp"

namespace stageid {

ScatterAverage::ScatterAverage(Eigen::Index outputs, Eigen::Index inputs, Eigen::Index lines) {
  mean_.setZero(outputs * inputs, lines);
  scatter_.setZero(outputs * inputs, lines);
  weight_.setZero(inputs, lines);
  residual_.setZero(outputs, lines);
  dof_.setZero(lines);
}

void ScatterAverage::add(const LineEstimate& line, const LineNoise& noise, double dof,
                         Eigen::Index k) {
  const Eigen::Index outputs = residual_.rows();
  residual_.col(k) += dof * noise.residual.diagonal().real();
  dof_[k] += dof;
  // West's recursion: Welford's with weights.
  for (Eigen::Index j = 0; j < weight_.rows(); ++j) {
    const double weight = 1.0 / noise.input_part(j, j).real();
    weight_(j, k) += weight;
    const double share = weight / weight_(j, k);
    for (Eigen::Index i = 0; i < outputs; ++i) {
      const Eigen::Index c = i + outputs * j;
      const std::complex<double> deviation = line.G(i, j) - mean_(c, k);
      mean_(c, k) += share * deviation;
      scatter_(c, k) += weight * (1.0 - share) * std::norm(deviation);
    }
  }
}

RealizationScatter ScatterAverage::finish(int realizations) const {
  const Eigen::Index outputs = residual_.rows();
  const Eigen::MatrixXd residual = residual_ * dof_.cwiseInverse().asDiagonal();
  RealizationScatter found;
  found.total = scatter_ / (realizations - 1.0);
  found.noise.resize(scatter_.rows(), scatter_.cols());
  for (Eigen::Index j = 0; j < weight_.rows(); ++j) {
    const auto weight = weight_.row(j).array();
    auto total = found.total.middleRows(outputs * j, outputs).array();
    total.rowwise() /= weight;
    found.noise.middleRows(outputs * j, outputs) = (residual.array().rowwise() / weight).matrix();
  }
  return found;
}

}  // namespace stageid
