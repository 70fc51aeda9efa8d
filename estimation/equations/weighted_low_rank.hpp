#pragma once

#include <Eigen/Core>

namespace stageid {

/// Approximations of a matrix by matrices of low rank, with a weight for each entry.
class WeightedLowRank {
 public:
  /// @param L n x m. @param weight n x m, not negative, for example inverse variances
  WeightedLowRank(const Eigen::MatrixXcd& L, const Eigen::MatrixXd& weight);

  struct Factors {
    Eigen::MatrixXcd phi;  ///< n x rank
    Eigen::MatrixXcd psi;  ///< m x rank
    double distance;       ///< the sum below
  };
  /// A minimum of sum weight |L - phi psi^T|^2, by alternating least squares. Separable weights (a product of one number
  /// per row and one per column) have their minimum in the singular vectors of the scaled matrix, where it begins.
  Factors factors(Eigen::Index rank) const;

  /// A lower bound of this sum for all matrices of a rank; for separable weights, the minimum. Needs no iteration.
  double least_distance(Eigen::Index rank) const;

 private:
  Eigen::MatrixXcd L_;
  Eigen::MatrixXd weight_;
  Eigen::VectorXd column_scale_;     // m: square roots of the separable weights
  Eigen::VectorXd singular_values_;  // of the scaled matrix
  Eigen::MatrixXcd right_;           // its right singular vectors, m x min(n, m)
  double least_ratio_ = 0.0;         // of a weight to the separable one
};

}  // namespace stageid
