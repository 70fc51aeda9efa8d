#include "estimation/equations/weighted_low_rank.hpp"

#include <Eigen/Cholesky>
#include <complex>
#include <limits>

#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

constexpr int kSweeps = 30;  // of the alternating least squares; a fit continues from there
constexpr double kGainOfASweep = 1e-10;  // of the sum: less has converged

/// x of L = x fixed^T by weighted least squares, row by row.
Eigen::MatrixXcd solve_rows(const Eigen::MatrixXcd& L, const Eigen::MatrixXd& weight,
                            const Eigen::MatrixXcd& fixed) {
  Eigen::MatrixXcd x(L.rows(), fixed.cols());
  for (Eigen::Index r = 0; r < L.rows(); ++r) {
    const Eigen::MatrixXcd weighted =
        weight.row(r).transpose().cast<Complex>().asDiagonal() * fixed.conjugate();
    Eigen::MatrixXcd normal = weighted.transpose() * fixed;
    normal.diagonal().array() += 1e-14 * normal.diagonal().real().maxCoeff() + 1e-300;
    const Eigen::VectorXcd rhs = weighted.transpose() * L.row(r).transpose();
    x.row(r) = normal.ldlt().solve(rhs).transpose();
  }
  return x;
}

}  // namespace

WeightedLowRank::WeightedLowRank(const Eigen::MatrixXcd& L, const Eigen::MatrixXd& weight)
    : L_(L), weight_(weight) {
  // The nearest separable weights, in the mean of the logarithms.
  const Eigen::MatrixXd logarithm =
      weight.cwiseMax(1e-30 * weight.maxCoeff()).cwiseMax(1e-300).array().log();
  const Eigen::VectorXd row_scale = (0.5 * logarithm.rowwise().mean()).array().exp();
  column_scale_ = (0.5 * (logarithm.colwise().mean().array() - logarithm.mean())).exp();
  const Eigen::MatrixXd scale = row_scale * column_scale_.transpose();
  const Eigen::MatrixXcd scaled = L.cwiseProduct(scale);
  const auto decomposition = svd(scaled, Eigen::ComputeThinV);
  singular_values_ = decomposition.singularValues();
  right_ = decomposition.matrixV();
  least_ratio_ = weight.cwiseQuotient(scale.cwiseAbs2()).minCoeff();
}

WeightedLowRank::Factors WeightedLowRank::factors(Eigen::Index rank) const {
  Factors f;
  f.psi = column_scale_.cwiseInverse().asDiagonal() * right_.leftCols(rank).conjugate();
  f.distance = std::numeric_limits<double>::infinity();
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    f.phi = solve_rows(L_, weight_, f.psi);
    f.psi = solve_rows(L_.transpose(), weight_.transpose(), f.phi);
    const double before = f.distance;
    f.distance = (L_ - f.phi * f.psi.transpose()).cwiseAbs2().cwiseProduct(weight_).sum();
    if (!(f.distance < (1.0 - kGainOfASweep) * before)) break;
  }
  return f;
}

double WeightedLowRank::least_distance(Eigen::Index rank) const {
  const Eigen::Index rest = singular_values_.size() - rank;
  return rest <= 0 ? 0.0 : least_ratio_ * singular_values_.tail(rest).squaredNorm();
}

}  // namespace stageid
