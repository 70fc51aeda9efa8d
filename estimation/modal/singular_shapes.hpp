#pragma once

#include <Eigen/Core>
#include <complex>

namespace stageid {

/// The leading component of a shape is the first of at least this share of the largest magnitude.
constexpr double kLeadingComponent = 0.9;

/// A matrix (n_y x n_u) as a sum of products of an output shape and an input shape,
///   M = sum_r singular_value_r  output_r  input_r^T     (transposed, not conjugated),
/// columns of norm one, the largest singular value first. Each pair of columns is rotated so that the leading
/// component of the output shape is real and positive. That is the first whose magnitude is at least 0.9 of the
/// largest, so that rounding does not choose among the equal ones of a symmetric shape.
template <typename Scalar>
struct SingularShapes {
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> output;  ///< n_y x min(n_y, n_u)
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> input;   ///< n_u x min(n_y, n_u)
  Eigen::VectorXd singular_value;
};

SingularShapes<double> singular_shapes(const Eigen::MatrixXd& M);
SingularShapes<std::complex<double>> singular_shapes(const Eigen::MatrixXcd& M);

/// Singular values up to this share of a reference, usually the first, are considered rounding.
constexpr double kRankTolerance = 1e-10;

/// Number of (falling) singular values above kRankTolerance * reference.
Eigen::Index numerical_rank(const Eigen::VectorXd& singular_values, double reference);

}  // namespace stageid
