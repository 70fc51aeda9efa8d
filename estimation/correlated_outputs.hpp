#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/fit_problem.hpp"

namespace stageid {

/// Correlation of the outputs' noise from the FRF's residual covariance, (n_y n_y) x N, column k =
/// vec(R_k) with R_k(y, z) = E e_y conj(e_z) over the deviations; empty if it has none.
Eigen::MatrixXcd output_correlation(const FrfEstimate& frf);

/// Columns of all outputs of one input, one matrix (N x n) an output.
struct OutputColumns {
  std::vector<Eigen::MatrixXd> re;
  std::vector<Eigen::MatrixXd> im;
};

/// On every line the outputs of X combined, Y_y = sum_z R(y, z) X_z: with X = C_diag^1/2 W J of all
/// outputs,  sum_y X_y^H Y_y = J^H W C W J.
OutputColumns correlated(const Eigen::MatrixXcd& correlation, const OutputColumns& X);

/// sum_k Re{X^H Y} over all outputs, symmetric where Y = correlated(X).
Eigen::MatrixXd correlated_gram(const OutputColumns& X, const OutputColumns& Y);

}  // namespace stageid
