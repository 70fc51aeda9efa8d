#include "estimation/modal/singular_shapes.hpp"

#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

Complex conjugate(Complex value) { return std::conj(value); }
double conjugate(double value) { return value; }

template <typename Shape>
auto leading_component(const Shape& shape) {
  const double largest = shape.cwiseAbs().maxCoeff();
  Eigen::Index i = 0;
  while (std::abs(shape[i]) < kLeadingComponent * largest) ++i;
  return shape[i];
}

template <typename Scalar>
SingularShapes<Scalar> decompose(
    const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& matrix) {
  const auto parts = svd(matrix, Eigen::ComputeThinU | Eigen::ComputeThinV);
  SingularShapes<Scalar> out{parts.matrixU(), parts.matrixV().conjugate(), parts.singularValues()};
  for (Eigen::Index r = 0; r < out.output.cols(); ++r) {
    const Scalar leading = leading_component(out.output.col(r));
    const Scalar turn = conjugate(leading) / std::abs(leading);
    out.output.col(r) *= turn;
    out.input.col(r) *= conjugate(turn);
  }
  return out;
}

}  // namespace

SingularShapes<double> singular_shapes(const Eigen::MatrixXd& M) { return decompose<double>(M); }

SingularShapes<Complex> singular_shapes(const Eigen::MatrixXcd& M) { return decompose<Complex>(M); }

Eigen::Index numerical_rank(const Eigen::VectorXd& singular_values, double reference) {
  Eigen::Index rank = 0;
  while (rank < singular_values.size() && singular_values[rank] > kRankTolerance * reference)
    ++rank;
  return rank;
}

}  // namespace stageid
