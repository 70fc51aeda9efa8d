#include "frf/response/line_estimate.hpp"

#include <algorithm>
#include <cmath>

#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

// float32 records have errors of 1e-8, so smaller values may be an exact dependence.
constexpr double kSmallestReciprocalCondition = 1e-6;
// U may be far from orthogonal in a stiff loop. Only values determined by rounding are refused.
constexpr double kSmallestReciprocalConditionOfInputs = 1e-13;

/// For matrices whose entries cannot overflow: hypot() would take as long as the inverse.
double one_norm(const Eigen::MatrixXcd& M) {
  return M.cwiseAbs2().cwiseSqrt().colwise().sum().maxCoeff();
}

double spectral_norm(const Eigen::MatrixXcd& M) {
  const Eigen::MatrixXcd gram =
      M.rows() <= M.cols() ? Eigen::MatrixXcd(M * M.adjoint()) : Eigen::MatrixXcd(M.adjoint() * M);
  return std::sqrt(std::max(0.0, hermitian_eigenvalues(gram).maxCoeff()));
}

/// Inverse of a square matrix. Empty if its reciprocal condition number, after scaling the rows to norm one (their
/// units differ), is below `smallest` or NaN.
Eigen::MatrixXcd scaled_inverse(const Eigen::MatrixXcd& M, double smallest) {
  const Eigen::VectorXd row_norm = M.rowwise().norm();
  if (!(row_norm.minCoeff() > 0.0)) return {};
  const Eigen::VectorXd scale = row_norm.cwiseInverse();
  const Eigen::MatrixXcd scaled = scale.asDiagonal() * M;
  const Eigen::MatrixXcd inverse_scaled = inverse(scaled);
  const double reciprocal_condition = 1.0 / (one_norm(scaled) * one_norm(inverse_scaled));
  if (!(reciprocal_condition >= smallest)) return {};
  return inverse_scaled * scale.asDiagonal();
}

/// R^+ with R R^+ = I; empty if the rows of R are linearly dependent.
Eigen::MatrixXcd right_inverse(const Eigen::MatrixXcd& R) {
  if (R.rows() == R.cols()) return scaled_inverse(R, kSmallestReciprocalCondition);
  const Eigen::VectorXd row_norm = R.rowwise().norm();
  if (!(row_norm.minCoeff() > 0.0)) return {};
  const Eigen::MatrixXcd scaled = row_norm.cwiseInverse().asDiagonal() * R;
  const Eigen::MatrixXcd gram_inverse = scaled_inverse(
      scaled * scaled.adjoint(), kSmallestReciprocalCondition * kSmallestReciprocalCondition);
  if (gram_inverse.size() == 0) return {};
  return scaled.adjoint() * gram_inverse * row_norm.cwiseInverse().asDiagonal();
}

}  // namespace

LineEstimate estimate_line(const Eigen::MatrixXcd& R, const Eigen::MatrixXcd& Z,
                           Eigen::Index outputs) {
  LineEstimate line;
  const Eigen::MatrixXcd R_inverse = right_inverse(R);
  if (R_inverse.size() == 0) {
    line.status = LineStatus::singular_excitation;
    return line;
  }
  line.Z_by_R = Z * R_inverse;
  const Eigen::Index inputs = Z.rows() - outputs;
  const Eigen::MatrixXcd U_inverse =
      scaled_inverse(line.Z_by_R.bottomRows(inputs), kSmallestReciprocalConditionOfInputs);
  if (U_inverse.size() == 0) {
    line.status = LineStatus::singular_inputs;
    return line;
  }
  line.Q = R_inverse * U_inverse;
  line.G = line.Z_by_R.topRows(outputs) * U_inverse;
  line.input_condition = spectral_norm(Z.bottomRows(inputs)) * spectral_norm(line.Q);
  return line;
}

Eigen::MatrixXcd residual_of_Z(const Eigen::MatrixXcd& G) {
  Eigen::MatrixXcd factor(G.rows(), G.rows() + G.cols());
  factor.leftCols(G.rows()).setIdentity();
  factor.rightCols(G.cols()) = -G;
  return factor;
}

Eigen::MatrixXcd residual_covariance(const Eigen::MatrixXcd& G, const Eigen::MatrixXcd& scatter,
                                     int dof) {
  const Eigen::MatrixXcd factor = residual_of_Z(G);
  const Eigen::MatrixXcd residual = factor * scatter * factor.adjoint() / static_cast<double>(dof);
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
