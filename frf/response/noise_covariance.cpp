#include "frf/response/noise_covariance.hpp"

namespace stageid {

Eigen::MatrixXcd residual_covariance(const Eigen::MatrixXcd& G, const Eigen::MatrixXcd& scatter,
                                     int dof) {
  Eigen::MatrixXcd residual_of_Z(G.rows(), scatter.rows());  // [I, -G]
  residual_of_Z.leftCols(G.rows()).setIdentity();
  residual_of_Z.rightCols(G.cols()) = -G;
  const Eigen::MatrixXcd residual =
      residual_of_Z * scatter * residual_of_Z.adjoint() / static_cast<double>(dof);
  return 0.5 * (residual + residual.adjoint());
}

LineNoise line_noise(const LineEstimate& estimate, const Eigen::MatrixXcd& scatter, int dof,
                     const Eigen::VectorXd& periods) {
  LineNoise noise;
  noise.residual = residual_covariance(estimate.G, scatter, dof);
  const Eigen::VectorXd weight = periods.cwiseInverse();
  noise.input_part = estimate.Q.transpose() * weight.asDiagonal() * estimate.Q.conjugate();
  noise.gain = noise.input_part.diagonal().real().transpose().replicate(estimate.G.rows(), 1);
  noise.mean_of_periods = weight.mean();
  return noise;
}

}  // namespace stageid
